//! All passes that draw the ground put a vertex in exactly the same place, so that a depth prepass leaves no holes.
//!
//! Whether two shaders differ in the last bit of a depth depends on the compiler of a driver. So this test looks at the
//! shaders themselves, composed as Bevy does it, without a GPU: in every pass the position is `@invariant`, and
//! computed by the same operations on the same inputs.
#![cfg(feature = "examples")]

mod formula;
#[allow(dead_code, reason = "nothing is drawn")]
#[path = "../../examples/shared/offscreen.rs"]
mod offscreen;

use std::collections::{HashMap, HashSet};
use std::time::{Duration, Instant};

use bevy::pbr::Material;
use bevy::prelude::*;
use bevy::shader::{ShaderCache, ShaderCacheSource, ShaderDefVal, ShaderRef};
use bevy_burrow::prelude::*;
use bevy_burrow::view::prepass_vertex_shader;
use formula::Position;
use naga::Module;
use wgpu_types::{DownlevelFlags, Features};

/// What both passes of a material may be compiled with besides: depth, normals, motion, deferred; dithering; colours.
const PREPASSES: [&[&str]; 6] = [
    &["DEPTH_PREPASS"],
    &["DEPTH_PREPASS", "NORMAL_PREPASS", "NORMAL_PREPASS_OR_DEFERRED_PREPASS", "PREPASS_FRAGMENT"],
    &[
        "DEPTH_PREPASS",
        "MOTION_VECTOR_PREPASS",
        "MOTION_VECTOR_PREPASS_OR_DEFERRED_PREPASS",
        "PREPASS_FRAGMENT",
    ],
    &[
        "DEPTH_PREPASS",
        "NORMAL_PREPASS",
        "NORMAL_PREPASS_OR_DEFERRED_PREPASS",
        "MOTION_VECTOR_PREPASS",
        "MOTION_VECTOR_PREPASS_OR_DEFERRED_PREPASS",
        "PREPASS_FRAGMENT",
    ],
    DEFERRED,
    &[
        "DEPTH_PREPASS",
        "DEFERRED_PREPASS",
        "NORMAL_PREPASS_OR_DEFERRED_PREPASS",
        "MOTION_VECTOR_PREPASS",
        "MOTION_VECTOR_PREPASS_OR_DEFERRED_PREPASS",
        "PREPASS_FRAGMENT",
    ],
];

const DEFERRED: &[&str] = &[
    "DEPTH_PREPASS",
    "DEFERRED_PREPASS",
    "NORMAL_PREPASS_OR_DEFERRED_PREPASS",
    "MOTION_VECTOR_PREPASS_OR_DEFERRED_PREPASS",
    "PREPASS_FRAGMENT",
];

/// What a mesh or a camera adds to any pass.
const CHOICES: [&str; 3] = ["VERTEX_COLORS", "VISIBILITY_RANGE_DITHER", "GROUND_ATTRIBUTES"];

const PROJECTIONS: [&str; 3] =
    ["VIEW_PROJECTION_PERSPECTIVE", "VIEW_PROJECTION_ORTHOGRAPHIC", "VIEW_PROJECTION_NONSTANDARD"];

/// The definitions of all passes: those of the main pass, then those of prepasses.
fn passes() -> (Vec<Vec<ShaderDefVal>>, Vec<Vec<ShaderDefVal>>) {
    let common = |projection: &str, choices: u32| {
        let chosen = CHOICES.iter().enumerate().filter(move |(at, _)| choices >> at & 1 == 1);
        let names = ["VERTEX_POSITIONS", "VERTEX_NORMALS", "VERTEX_OUTPUT_INSTANCE_INDEX", projection];
        let mut definitions: Vec<ShaderDefVal> = names.into_iter().map(ShaderDefVal::from).collect();
        definitions.extend(chosen.map(|(_, name)| ShaderDefVal::from(*name)));
        definitions.push(ShaderDefVal::UInt("MATERIAL_BIND_GROUP".into(), 3));
        definitions.push(ShaderDefVal::UInt("AVAILABLE_STORAGE_BUFFER_BINDINGS".into(), 8));
        definitions
    };
    let all = || {
        PROJECTIONS.iter().flat_map(|projection| (0..1 << CHOICES.len()).map(move |set| (projection, set)))
    };
    let main = all().flat_map(|(projection, set)| {
        ["", "MULTISAMPLED", "DEPTH_PREPASS"].map(|more| {
            let mut definitions = common(projection, set);
            definitions.extend((!more.is_empty()).then(|| more.into()));
            definitions
        })
    });
    let prepasses = all().flat_map(|(projection, set)| {
        PREPASSES.map(|names| {
            let mut definitions = common(projection, set);
            definitions.extend(names.iter().map(|name| ShaderDefVal::from(*name)));
            definitions.push("PREPASS_PIPELINE".into());
            definitions
        })
    });
    (main.collect(), prepasses.collect())
}

/// Whether the ground draws a prepass with the shader of its main pass: deferred, or with normals, which have relief.
fn is_drawn_by_ground(definitions: &[ShaderDefVal]) -> bool {
    is_deferred(definitions) || definitions.contains(&"NORMAL_PREPASS".into())
}

fn is_deferred(definitions: &[ShaderDefVal]) -> bool {
    definitions.contains(&"DEFERRED_PREPASS".into())
}

/// Every shader that an app with `BurrowPlugins` has loaded, and Bevy's way to compose them.
struct Shaders {
    app: App,
    cache: ShaderCache<Module, ()>,
    /// Bevy's prepass shader, and the one of the example with its own vertex shader.
    bevy_prepass: AssetId<Shader>,
    map: AssetId<Shader>,
}

impl Shaders {
    fn load() -> Self {
        let mut app = offscreen::build(None, |app| {
            app.add_plugins(BurrowPlugins);
        });
        let assets = app.world().resource::<AssetServer>().clone();
        let bevy_prepass: Handle<Shader> = assets.load("embedded://bevy_pbr/prepass/prepass.wgsl");
        let mut wanted = vec![bevy_prepass.clone()];
        wanted.extend(
            [GroundMaterial::vertex_shader(), prepass_vertex_shader()].map(|shader| load(&assets, shader)),
        );
        let start = Instant::now();
        loop {
            let missing = missing(&app, &wanted);
            if missing.is_empty() {
                break;
            }
            assert!(start.elapsed() < Duration::from_secs(60), "not loaded in time: {missing:?}");
            app.update();
            std::thread::sleep(Duration::from_millis(1));
        }
        let map = Shader::from_wgsl(include_str!("../../examples/custom_material/map.wgsl"), "map.wgsl");
        let map = app.world_mut().resource_mut::<Assets<Shader>>().add(map);
        let mut cache =
            ShaderCache::new((), Features::all_webgpu_mask(), DownlevelFlags::all(), |(), source, _| {
                match source {
                    ShaderCacheSource::Naga(module) => Ok(module),
                    _ => unreachable!("Bevy's shaders and those of the ground are WGSL"),
                }
            });
        for (id, shader) in app.world().resource::<Assets<Shader>>().iter() {
            cache.set_shader(id, shader.clone());
        }
        Self { bevy_prepass: bevy_prepass.id(), map: map.id(), app, cache }
    }

    /// The position that a shader computes.
    fn position(&mut self, shader: AssetId<Shader>, definitions: &[ShaderDefVal]) -> Position {
        match self.cache.get(0, shader, definitions) {
            Ok(module) => Position::of(&module),
            Err(error) => panic!("{definitions:?}: {error}"),
        }
    }

    fn id(&self, shader: ShaderRef) -> AssetId<Shader> {
        load(self.app.world().resource::<AssetServer>(), shader).id()
    }

    /// The vertex shader of a material in a pass.
    fn vertex_shader_of<M: Material>(&self, definitions: &[ShaderDefVal]) -> AssetId<Shader> {
        let shader = match (definitions.contains(&"PREPASS_PIPELINE".into()), is_deferred(definitions)) {
            (false, _) => M::vertex_shader(),
            (true, false) => M::prepass_vertex_shader(),
            (true, true) => M::deferred_vertex_shader(),
        };
        if matches!(shader, ShaderRef::Default) { self.bevy_prepass } else { self.id(shader) }
    }
}

fn load(assets: &AssetServer, shader: ShaderRef) -> Handle<Shader> {
    match shader {
        ShaderRef::Path(path) => assets.load(path),
        ShaderRef::Handle(handle) => handle,
        ShaderRef::Default => panic!("a shader of its own"),
    }
}

/// What is not loaded yet of these shaders and what they import.
fn missing(app: &App, wanted: &[Handle<Shader>]) -> Vec<String> {
    let shaders = app.world().resource::<Assets<Shader>>();
    let by_path: HashMap<_, _> =
        shaders.iter().map(|(id, shader)| (shader.import_path.clone(), id)).collect();
    let mut queue: Vec<AssetId<Shader>> = wanted.iter().map(Handle::id).collect();
    let (mut seen, mut missing) = (HashSet::new(), Vec::new());
    while let Some(id) = queue.pop() {
        let Some(shader) = shaders.get(id) else {
            missing.push(format!("{id:?}"));
            continue;
        };
        for import in shader.imports.iter().filter(|import| seen.insert((*import).clone())) {
            match by_path.get(import) {
                Some(id) => queue.push(*id),
                None => missing.push(format!("{import:?}")),
            }
        }
    }
    missing
}

/// What differs between the positions of a shader's main pass and those of its prepasses.
fn differences(positions: &[(String, Position)]) -> Vec<String> {
    let mut faults = Vec::new();
    let first = &positions[0].1.formula;
    for (pass, position) in positions {
        if !position.is_invariant {
            faults.push(format!("{pass}: the position is not invariant"));
        }
        if position.formula != *first {
            faults.push(format!("{pass}: {} is not {first}", position.formula));
        }
    }
    faults
}

#[test]
fn every_pass_of_the_ground_computes_the_same_position() {
    let mut shaders = Shaders::load();
    let (main, prepasses) = passes();
    let positions: Vec<_> = main
        .iter()
        .chain(&prepasses)
        .map(|definitions| {
            let shader = if is_drawn_by_ground(definitions) {
                shaders.id(GroundMaterial::vertex_shader())
            } else {
                shaders.vertex_shader_of::<GroundMaterial>(definitions)
            };
            (format!("{definitions:?}"), shaders.position(shader, definitions))
        })
        .collect();
    let faults = differences(&positions);
    assert!(faults.is_empty(), "{} of {}:\n{}", faults.len(), positions.len(), faults[0]);
    // The formula is one: neither empty nor cut off by a branch.
    let formula = &positions[0].1.formula;
    let parts = ["location 0", "InstanceIndex", "clip_from_world"];
    assert!(
        !formula.contains("branch") && formula.contains("location 0"),
        "{formula} lacks one of {parts:?}"
    );
}

#[test]
fn a_material_with_its_own_vertex_shader_agrees_with_the_prepass_that_it_is_offered() {
    let mut shaders = Shaders::load();
    let (map, prepass) = (shaders.map, shaders.id(prepass_vertex_shader()));
    let (main, prepasses) = passes();
    let positions: Vec<_> = main
        .iter()
        .map(|definitions| (map, definitions))
        .chain(
            prepasses
                .iter()
                .filter(|definitions| !is_deferred(definitions))
                .map(|definitions| (prepass, definitions)),
        )
        .map(|(shader, definitions)| (format!("{definitions:?}"), shaders.position(shader, definitions)))
        .collect();
    assert_eq!(differences(&positions), Vec::<String>::new());
}

#[test]
fn shaders_that_may_differ_are_found() {
    let mut shaders = Shaders::load();
    let (main, prepasses) = passes();
    let ground = shaders.id(GroundMaterial::vertex_shader());
    let drawn = ("main".to_string(), shaders.position(ground, &main[0]));
    // Bevy's prepass, which is not invariant.
    let bevy = shaders.position(shaders.bevy_prepass, &prepasses[0]);
    assert!(!differences(&[drawn.clone(), ("Bevy's prepass".into(), bevy)]).is_empty());
    // One that is invariant, and takes another way to the same place.
    let source = "
        #import bevy_pbr::{mesh_functions, mesh_view_bindings::view}
        struct Vertex { @builtin(instance_index) instance: u32, @location(0) position: vec3<f32> }
        struct Varying { @invariant @builtin(position) position: vec4<f32> }
        @vertex
        fn vertex(in: Vertex) -> Varying {
            var out: Varying;
            let world_from_local = mesh_functions::get_world_from_local(in.instance);
            out.position = (view.clip_from_world * world_from_local) * vec4(in.position, 1.0);
            return out;
        }";
    let other =
        shaders.app.world_mut().resource_mut::<Assets<Shader>>().add(Shader::from_wgsl(source, "other.wgsl"));
    let shader = shaders.app.world().resource::<Assets<Shader>>().get(&other).expect("just added").clone();
    shaders.cache.set_shader(other.id(), shader);
    let other = shaders.position(other.id(), &main[0]);
    assert!(other.is_invariant);
    assert!(!differences(&[drawn, ("another order".into(), other)]).is_empty());
}
