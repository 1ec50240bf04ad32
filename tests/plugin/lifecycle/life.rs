//! The life of a terrain in an app: lets events happen to it, and checks the laws.

use super::*;

/// Something that was asked of a terrain, in order.
#[derive(Clone, Debug)]
pub(super) enum Request {
    Brush(Brush),
    Step(OrderKind),
    /// A game's own edit, which is done at once.
    Own(Brush),
}

/// What is expected of one terrain on an entity.
pub(super) struct Expected {
    pub(super) ground: Arc<Ground>,
    /// A plain model, which did all that was checked.
    pub(super) plain: Terrain,
    /// What was asked since, in order.
    pub(super) requests: Vec<Request>,
    /// The terrain as its server has it.
    pub(super) served: Option<Terrain>,
}

impl Expected {
    /// A terrain, and what is expected of it.
    pub(super) fn new(load: Load, rng: &mut Rng, voxel_size: f32) -> (Terrain, Self) {
        let noise = NoiseHeights { seed: rng.u32(..), scale: 24.0, amplitude: 12.0, base: 4.0, ..default() };
        let ground = Arc::new(Ground::from_noise(64, 64, &noise).expect("valid"));
        let model = || {
            let settings = TerrainSettings { chunk_size: 16, voxel_size };
            Terrain::new(Arc::clone(&ground), &settings).expect("valid")
        };
        let mut plain = model();
        match load {
            Load::Loose => plain.set_loose(Some(loose())),
            #[cfg(feature = "store")]
            Load::StartLevel => {
                plain.apply((0..3).map(|number| {
                    let at = Vec3::new(10.0 + 20.0 * number as f32, 5.0, 30.0);
                    Brush::dig(Shape::sphere(at, 4.0 + rng.u32(0..4) as f32))
                }));
                let level = bevy_burrow::format::Level::of(&plain);
                plain = level.terrain(Arc::clone(&ground)).expect("its own ground");
            }
            _ => {}
        }
        let (new, served) = (model(), load.is_shared().then(model));
        (new, Self { ground, plain, requests: Vec::new(), served })
    }
}

pub(super) fn loose() -> LooseSettings {
    LooseSettings { crumbs: 64, debris: 4096, ..default() }
}

/// Makes transactions slow while it is asked to, so that things happen in the middle of them.
pub(super) struct Slow(pub(super) Arc<AtomicBool>);

impl SurfaceProcessor for Slow {
    fn wants(&self, _: &Part) -> bool {
        if self.0.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(2));
        }
        false
    }

    fn build(&self, _: &Part, _: &SurfaceMesh) -> Option<CommitAction> {
        None
    }
}

#[derive(Resource, Clone, PartialEq)]
pub(super) struct Runs(pub(super) bool);

/// An app in which things happen to a terrain.
pub(super) struct Life {
    pub(super) stage: Stage,
    pub(super) terrain: Entity,
    pub(super) camera: Entity,
    pub(super) load: Load,
    pub(super) expected: Expected,
    pub(super) rng: Rng,
    pub(super) tag: u64,
    /// Brushes that must be answered once each.
    pub(super) sent: Vec<u64>,
    pub(super) steps_sent: usize,
    pub(super) steps_heard: usize,
    /// Whether something was sent that no frame has collected yet.
    pub(super) is_uncollected: bool,
    /// Whether a step is among that.
    pub(super) has_step: bool,
    pub(super) is_slow: Arc<AtomicBool>,
    /// Entities and meshes before there was a terrain.
    pub(super) before: (usize, usize),
    /// How long is waited for anything.
    pub(super) patience: Duration,
    #[cfg(feature = "store")]
    pub(super) saves: Saves,
}

/// The folders of saved worlds, and what they have to hold.
#[cfg(feature = "store")]
pub(super) struct Saves {
    pub(super) folder: std::path::PathBuf,
    /// The number of worlds.
    pub(super) count: usize,
    /// Worlds that were open: each with its ground and hash.
    pub(super) left: Vec<(std::path::PathBuf, Arc<Ground>, u64)>,
}

/// Tiles that had no parent when they were added.
#[derive(Resource, Default)]
pub(super) struct Lonely(pub(super) usize);

impl Life {
    pub(super) fn new(load: Load, seed: u64) -> Self {
        Self::with(load, seed, |_| {})
    }

    /// A life in an app that is changed before there is a terrain.
    pub(super) fn with(load: Load, seed: u64, change: impl FnOnce(&mut App)) -> Self {
        let mut stage = load.stage().recording::<HistoryMoved>();
        #[cfg(feature = "render")]
        stage.app.init_asset::<StandardMaterial>();
        // In half of the lives each transaction is committed in the frame in which it begins, where that may be.
        let same_frame = Duration::from_secs(if seed % 2 == 1 { 60 } else { 0 });
        stage
            .app
            .insert_resource(BurrowSettings {
                loads_per_frame: 8,
                swaps_per_frame: 24,
                same_frame,
                ..default()
            })
            .init_resource::<Lonely>()
            .add_observer(|new: On<Add, Tile>, parents: Query<&ChildOf>, mut lonely: ResMut<Lonely>| {
                lonely.0 += usize::from(!parents.contains(new.entity));
            });
        stage.run_while(Runs(true));
        change(&mut stage.app);
        let mut rng = Rng::with_seed(seed);
        let place = Transform::from_xyz(20.0, 30.0, 20.0);
        let camera = (Camera::default(), bevy::camera::Projection::default(), place);
        let camera = stage.app.world_mut().spawn(camera).id();
        #[cfg(feature = "avian")]
        if load == Load::Physics {
            let source = bevy_burrow::physics::ColliderSource { radius: 40.0 };
            stage.app.world_mut().spawn((source, Transform::from_xyz(40.0, 20.0, 40.0)));
        }
        let is_slow = Arc::<AtomicBool>::default();
        stage.app.world_mut().resource_mut::<SurfaceProcessors>().add(Slow(Arc::clone(&is_slow)));
        let before = (entities(&mut stage), stage.meshes());
        let (model, expected) = Expected::new(load, &mut rng, 1.0);
        #[cfg(feature = "store")]
        let saves = {
            let name = format!("burrow-life-{}-{load:?}-{seed}", std::process::id());
            let folder = std::env::temp_dir().join(name);
            drop(std::fs::remove_dir_all(&folder));
            Saves { folder, count: 0, left: Vec::new() }
        };
        let mut life = Self {
            stage,
            terrain: Entity::PLACEHOLDER,
            camera,
            load,
            expected,
            rng,
            tag: 0,
            sent: Vec::new(),
            steps_sent: 0,
            steps_heard: 0,
            is_uncollected: false,
            has_step: false,
            is_slow,
            before,
            patience: Duration::from_secs(120),
            #[cfg(feature = "store")]
            saves,
        };
        life.spawn(model);
        life
    }

    /// Spawns a terrain with its load.
    pub(super) fn spawn(&mut self, model: Terrain) {
        self.terrain = self.stage.app.world_mut().spawn(model).id();
        let load = self.load;
        let mut entity = self.stage.app.world_mut().entity_mut(self.terrain);
        match load {
            Load::Nothing => {}
            Load::Levels => {
                entity.insert(levels());
            }
            Load::Loose => {
                entity.insert(loose());
            }
            Load::Layers => {
                entity.insert(RenderLayers::from_layers(&[0, 3]));
            }
            Load::SlimVertices => {
                entity.insert(SlimVertices);
            }
            Load::Parent => {
                let id = entity.id();
                let root = (Transform::from_xyz(32.0, 0.0, 64.0), Visibility::default());
                let root = self.stage.app.world_mut().spawn(root).id();
                self.stage.app.world_mut().entity_mut(id).insert(ChildOf(root));
            }
            #[cfg(feature = "render")]
            Load::Material => {
                let id = entity.id();
                let world = self.stage.app.world_mut();
                let material =
                    world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
                world.entity_mut(id).insert(MeshMaterial3d(material));
            }
            #[cfg(feature = "avian")]
            Load::Physics => {}
            #[cfg(feature = "examples")]
            Load::Look => {
                entity.insert(GroundLook::default());
            }
            #[cfg(feature = "store")]
            Load::Saved | Load::StartLevel => {}
            #[cfg(feature = "replicon")]
            Load::Shared => {
                entity.insert(bevy_burrow::together::SharedTerrain::default());
            }
        }
        self.begin_world();
    }

    /// Begins a world on the terrain that was just put in place: in a new folder, as a level, on a server.
    pub(super) fn begin_world(&mut self) {
        match self.load {
            #[cfg(feature = "store")]
            Load::Saved => {
                let saved = self.next_folder();
                self.stage.app.world_mut().entity_mut(self.terrain).insert(saved);
            }
            #[cfg(feature = "store")]
            Load::StartLevel => {
                let level = bevy_burrow::format::Level::of(&self.expected.plain);
                let level = BurrowLevel::new(&level).expect("it can be written");
                let world = self.stage.app.world_mut();
                let level = world.resource_mut::<Assets<BurrowLevel>>().add(level);
                world.entity_mut(self.terrain).insert(StartLevel(level));
            }
            #[cfg(feature = "replicon")]
            Load::Shared => {
                use bevy_burrow::net::{Server, ServerSettings, UndoPolicy};
                let served = self.expected.served.take().expect("a model for its server");
                let server = Server::new(served, ServerSettings { undo: UndoPolicy::Own, ..default() });
                self.stage.app.insert_resource(bevy_burrow::together::GroundServer::new(server));
            }
            _ => {}
        }
    }

    /// A folder that nobody had yet: former worlds may still be closing.
    #[cfg(feature = "store")]
    pub(super) fn next_folder(&mut self) -> SavedWorld {
        self.saves.count += 1;
        SavedWorld::new(self.saves.folder.join(self.saves.count.to_string()))
    }

    /// Records the digs that the folder of an open world must hold after the world is left.
    #[cfg(feature = "store")]
    pub(super) fn note_saved(&mut self) {
        let entity = self.stage.app.world().entity(self.terrain);
        if let (Some(saved), Some(terrain), true) =
            (entity.get::<SavedWorld>(), entity.get::<Terrain>(), entity.contains::<WorldStore>())
        {
            let (ground, hash) = (Arc::clone(&self.expected.ground), terrain.world().hash());
            self.saves.left.push((saved.path.clone(), ground, hash));
        }
    }

    /// Once the app has ended, the folder of each world holds its digs.
    #[cfg(feature = "store")]
    pub(super) fn check_saved(&self) {
        use bevy_burrow::store::{BaseChanged, Store, StoreOptions};
        for (path, ground, expected) in &self.saves.left {
            let options = StoreOptions { base_changed: BaseChanged::Refuse, ..StoreOptions::default() };
            let found = Store::open(path, Arc::clone(ground), options);
            let found = found.map(|(_, opened)| opened.terrain.world().hash()).map_err(|why| why.to_string());
            assert_eq!(found, Ok(*expected), "the folder {}", path.display());
        }
    }

    pub(super) fn is_alive(&self) -> bool {
        self.stage.app.world().get::<Terrain>(self.terrain).is_some()
    }

    /// A brush for the ground somewhere, in world space.
    pub(super) fn brush(&mut self) -> Brush {
        let (x, z) = (self.rng.u32(0..256) as f32 / 4.0, self.rng.u32(0..256) as f32 / 4.0);
        let ground = self.expected.plain.world();
        let height = ground.height(x.into(), z.into()).unwrap_or_default().round() as f32;
        // Quarters of voxels have the same bits in world space.
        let center = Vec3::new(x, height, z);
        let shape = Shape::sphere(center, 2.0 + self.rng.u32(0..16) as f32 / 4.0);
        let brush = match self.rng.u32(0..6) {
            0 => Brush::add(shape, MaterialId(4)),
            1 => Brush::dig(shape).with_roughness(Roughness::new(1.0, 3.0, self.rng.u32(..))),
            2 => Brush::reset(shape),
            3 => {
                let to = center + Vec3::new(6.0, -2.0, 4.0);
                Brush::dig(Shape::curve([center, center - Vec3::Y * 3.0, to + Vec3::X * 2.0, to], [2.0, 1.5]))
            }
            _ => Brush::dig(shape),
        };
        self.tag += 1;
        // Each has its own stroke: when a pause ends, brushes of many frames come at once.
        brush.with_tag(self.tag).with_stroke(self.tag)
    }

    /// Sends a brush in voxels of the terrain to the terrain, wherever that is.
    pub(super) fn dig(&mut self) {
        // Brushes of a frame are read before its steps.
        self.collect_steps();
        let brush = self.brush();
        self.sent.push(brush.tag);
        self.is_uncollected = true;
        let place = self.place();
        let Some(place) = place.filter(|_| self.is_alive()) else {
            self.stage.send(brush);
            return;
        };
        let (scale, rotation, translation) = place.to_scale_rotation_translation();
        let world = brush.clone().transformed(rotation, translation, scale.x);
        self.expected.requests.push(Request::Brush(brush));
        self.stage.send_to(self.terrain, world);
    }

    /// Where the terrain is, by the transforms of it and of its parent.
    pub(super) fn place(&self) -> Option<GlobalTransform> {
        let world = self.stage.app.world();
        let local = *world.get::<Transform>(self.terrain)?;
        let parent =
            world.get::<ChildOf>(self.terrain).and_then(|parent| world.get::<Transform>(parent.parent()));
        Some(parent.map_or(GlobalTransform::IDENTITY, |parent| GlobalTransform::from(*parent)) * local)
    }

    pub(super) fn step(&mut self, step: OrderKind) {
        if !self.is_alive() {
            return;
        }
        // And undos before redos.
        self.collect_steps();
        self.steps_sent += 1;
        self.is_uncollected = true;
        self.has_step = true;
        self.expected.requests.push(Request::Step(step));
        let terrain = Some(self.terrain);
        match step {
            OrderKind::Undo => self.stage.write(Undo { terrain }),
            _ => self.stage.write(Redo { terrain }),
        }
    }

    /// Replaces the terrain: answers for the old one are no longer expected.
    pub(super) fn renew(&mut self, voxel_size: f32) -> Terrain {
        self.collect();
        #[cfg(feature = "store")]
        {
            self.note_saved();
            // A level is for its own ground. A saved world closes automatically where another level takes the place of
            // its own.
            self.stage.app.world_mut().entity_mut(self.terrain).remove::<StartLevel>();
            if self.rng.bool() {
                self.stage.app.world_mut().entity_mut(self.terrain).remove::<SavedWorld>();
            }
        }
        let (model, expected) = Expected::new(self.load, &mut self.rng, voxel_size);
        self.expected = expected;
        model
    }

    /// Runs a frame so that everything that was sent reaches the present terrain.
    pub(super) fn collect(&mut self) {
        if self.is_uncollected {
            self.run(1);
        }
    }

    pub(super) fn collect_steps(&mut self) {
        if self.has_step {
            self.run(1);
        }
    }

    pub(super) fn run(&mut self, frames: usize) {
        self.stage.frames(frames);
        self.is_uncollected &= frames == 0;
        self.has_step &= frames == 0;
    }

    /// Brings the terrain into a phase.
    pub(super) fn reach(&mut self, phase: Phase) {
        match phase {
            Phase::Idle => self.settle(),
            Phase::Loading => {
                self.stage.app.world_mut().trigger(Redraw::default());
                self.run(2);
            }
            Phase::Transaction => {
                self.settle();
                self.is_slow.store(true, Ordering::Relaxed);
                self.dig();
                self.dig();
                // It is under way after this frame, however long others wait.
                let world = self.stage.app.world_mut();
                let waits = std::mem::take(&mut world.resource_mut::<BurrowSettings>().same_frame);
                self.run(1);
                self.stage.app.world_mut().resource_mut::<BurrowSettings>().same_frame = waits;
            }
            Phase::LevelChange => {
                self.settle();
                let to = Vec3::new(self.rng.f32() * 96.0, 25.0, self.rng.f32() * 96.0);
                self.stage.app.world_mut().get_mut::<Transform>(self.camera).expect("a camera").translation =
                    to;
                self.stage.frame();
            }
            Phase::Saving => {
                self.settle();
                self.dig();
                self.settle();
                #[cfg(feature = "store")]
                self.stage.write(SaveNow::default());
                self.stage.frame();
            }
        }
    }

    /// Runs some frames, perhaps none, with what is going on going on.
    pub(super) fn frames(&mut self) {
        let count = self.rng.usize(0..4);
        self.run(count);
    }

    pub(super) fn happen(&mut self, event: Event) {
        let terrain = self.terrain;
        match event {
            Event::Dig => (0..self.rng.usize(1..4)).for_each(|_| self.dig()),
            Event::DigBeside => {
                let brush = self.brush();
                self.sent.push(brush.tag);
                self.stage.send(brush.transformed(Quat::IDENTITY, Vec3::X * 9000.0, 1.0));
            }
            Event::Undo => self.step(OrderKind::Undo),
            Event::Redo => self.step(OrderKind::Redo),
            Event::OwnEdit => {
                self.settle();
                let brush = self.brush();
                let mut model =
                    self.stage.app.world_mut().get_mut::<Terrain>(terrain).expect("it is settled");
                model.apply([&brush]);
                self.expected.requests.push(Request::Own(brush));
            }
            Event::Replace | Event::ReplaceResized => {
                let voxel_size = if event == Event::Replace { 1.0 } else { 0.5 };
                let model = self.renew(voxel_size);
                self.stage.app.world_mut().entity_mut(terrain).insert(model);
                self.begin_again();
            }
            Event::Swap => {
                // What waits in a terrain goes where the terrain goes, so all is answered first.
                self.settle();
                let model = self.renew(1.0);
                let own = self.stage.app.world_mut().get_mut::<Terrain>(terrain);
                drop(std::mem::replace(&mut *own.expect("it is settled"), model));
                self.begin_again();
            }
            Event::RemoveAndInsert => {
                let model = self.renew(1.0);
                self.stage.app.world_mut().entity_mut(terrain).remove::<Terrain>();
                self.frames();
                self.stage.app.world_mut().entity_mut(terrain).insert(model);
                self.begin_again();
            }
            Event::DespawnAndSpawn => {
                let parent = self.stage.app.world().get::<ChildOf>(terrain).map(ChildOf::parent);
                self.collect();
                #[cfg(feature = "store")]
                self.note_saved();
                self.stage.app.world_mut().despawn(parent.unwrap_or(terrain));
                let (model, expected) = Expected::new(self.load, &mut self.rng, 1.0);
                self.expected = expected;
                self.frames();
                self.spawn(model);
            }
            Event::Disable => {
                self.collect();
                self.stage.app.world_mut().entity_mut(terrain).insert(Disabled);
                self.frames();
                self.stage.app.world_mut().entity_mut(terrain).remove::<Disabled>();
            }
            Event::Gate => {
                self.collect();
                self.stage.app.world_mut().resource_mut::<Runs>().0 = false;
                self.stage.frames(3);
                self.dig();
                self.stage.frames(3);
                self.is_uncollected = true;
                self.stage.app.world_mut().resource_mut::<Runs>().0 = true;
            }
            Event::Pause => {
                self.stage.app.world_mut().resource_mut::<Time<Virtual>>().pause();
                self.dig();
                self.frames();
                self.stage.app.world_mut().resource_mut::<Time<Virtual>>().unpause();
            }
            Event::Hold => {
                let is_held = self.stage.app.world().entity(terrain).contains::<Held>();
                self.stage.app.world_mut().entity_mut(terrain).insert(Held);
                self.dig();
                self.frames();
                if !is_held {
                    self.stage.app.world_mut().entity_mut(terrain).remove::<Held>();
                }
            }
            Event::Move => {
                self.collect();
                let to = Vec3::new(self.rng.i32(-9..9) as f32, self.rng.i32(-9..9) as f32, 32.0);
                self.stage.app.world_mut().get_mut::<Transform>(terrain).expect("a place").translation = to;
            }
            Event::Reparent => {
                self.collect();
                let root = (Transform::from_xyz(-64.0, 8.0, 0.0), Visibility::default());
                let world = self.stage.app.world_mut();
                let old = world.get::<ChildOf>(terrain).map(ChildOf::parent);
                let root = world.spawn(root).id();
                world.entity_mut(terrain).insert(ChildOf(root));
                if let Some(old) = old {
                    world.despawn(old);
                }
            }
            Event::Redraw => self.stage.app.world_mut().trigger(Redraw { terrain: Some(terrain) }),
            Event::CameraOff => {
                let mut camera = self.stage.app.world_mut().get_mut::<Camera>(self.camera).expect("a camera");
                camera.is_active = !camera.is_active;
            }
            Event::ToggleLevels => self.toggle(levels()),
            Event::ToggleLayers => self.toggle(RenderLayers::from_layers(&[0, 5])),
            Event::ToggleSlim => self.toggle(SlimVertices),
            Event::Hide => self.toggle(Visibility::Hidden),
            Event::DespawnPart => {
                // A tile that a game despawns by mistake returns with the next mesh; here all meshes are rebuilt.
                if let Some(&tile) = self.stage.with_component::<Chunk>().first() {
                    self.stage.app.world_mut().despawn(tile);
                    self.stage.app.world_mut().trigger(Redraw::default());
                }
            }
            Event::Another => {
                let (model, _) = Expected::new(self.load, &mut self.rng, 2.0);
                let place = Transform::from_xyz(4000.0, 0.0, 0.0);
                let other = self.stage.app.world_mut().spawn((model, place)).id();
                self.frames();
                self.stage.app.world_mut().despawn(other);
            }
            Event::SaveAnew => {
                // "Save as" while something may be under way.
                #[cfg(feature = "store")]
                {
                    self.note_saved();
                    if self.rng.bool() {
                        self.stage.app.world_mut().entity_mut(terrain).remove::<SavedWorld>();
                        self.dig();
                        self.frames();
                    }
                    let saved = self.next_folder();
                    self.stage.app.world_mut().entity_mut(terrain).insert(saved);
                }
            }
        }
    }

    /// After another terrain was put in place, its world begins at once, or, if it is to be saved, perhaps some frames
    /// later.
    pub(super) fn begin_again(&mut self) {
        if self.load.is_saved() && self.rng.bool() {
            self.frames();
        }
        self.begin_world();
    }

    pub(super) fn toggle<C: Component>(&mut self, component: C) {
        let mut entity = self.stage.app.world_mut().entity_mut(self.terrain);
        if std::any::TypeId::of::<C>() == std::any::TypeId::of::<Visibility>() {
            entity.insert(component);
        } else if entity.contains::<C>() {
            entity.remove::<C>();
        } else {
            entity.insert(component);
        }
    }

    /// Runs until something holds.
    pub(super) fn run_until(&mut self, what: &str, is_so: impl FnMut(&mut Stage) -> bool) {
        assert!(self.stage.frames_within(self.patience, is_so), "timed out waiting until {what}");
    }

    /// Runs until nothing is under way.
    pub(super) fn settle(&mut self) {
        let terrain = self.terrain;
        self.is_slow.store(false, Ordering::Relaxed);
        self.run(2);
        self.run_until("nothing is under way", |stage| {
            let world = stage.app.world();
            let model = world.get::<Terrain>(terrain).expect("it is there");
            let is_held = world.entity(terrain).contains::<Held>();
            let shown = world.get::<ShownLevels>(terrain);
            let has_lod = world.entity(terrain).contains::<LevelsOfDetail>();
            let levels = !has_lod || shown.is_some_and(|shown| shown.waiting == 0 && !shown.nodes.is_empty());
            !is_held && levels && model.queued() == 0 && !model.is_busy() && is_ready(stage)
        });
    }

    /// Runs until a server has answered everything, and what it said is shown.
    pub(super) fn settle_shared(&mut self) {
        let (sent, steps, heard) = (self.sent.len(), self.steps_sent, self.steps_heard);
        let mut moved = 0;
        let has_all = self.stage.frames_within(self.patience, |stage| {
            moved += stage.recorded::<HistoryMoved>().len();
            stage.tags().len() >= sent && heard + moved >= steps
        });
        let (tags, heard) = (self.stage.tags(), heard + moved);
        let missing: Vec<u64> = self.sent.iter().copied().filter(|tag| !tags.contains(tag)).collect();
        assert!(
            has_all,
            "the server has not answered brushes {missing:?}; {heard} of {steps} steps are answered"
        );
        self.steps_heard += moved;
    }

    /// Checks all laws.
    pub(super) fn check(&mut self, what: &dyn Debug) {
        self.settle();
        self.run(2);
        if self.load.is_shared() {
            self.settle_shared();
        }
        self.settle();
        self.steps_heard += self.stage.recorded::<HistoryMoved>().len();
        // Every message is answered, once.
        let mut tags = self.stage.tags();
        tags.sort_unstable();
        self.sent.sort_unstable();
        assert_eq!(tags, self.sent, "{what:?}: answers");
        assert_eq!(self.steps_heard, self.steps_sent, "{what:?}: answers to steps");
        // The world is that of a plain model which did what was answered as done.
        let applied = |tag: u64| {
            let receipt = self.stage.receipts().iter().find(|applied| applied.receipt.tag == tag);
            receipt.is_some_and(|applied| applied.receipt.outcome.is_ok())
        };
        let plain = &mut self.expected.plain;
        for request in self.expected.requests.drain(..) {
            match request {
                Request::Brush(brush) if !applied(brush.tag) => {}
                Request::Brush(brush) | Request::Own(brush) => {
                    plain.apply([brush]);
                }
                Request::Step(OrderKind::Undo) => {
                    plain.undo();
                }
                // Others may have dug there: who shares a terrain digs again.
                Request::Step(_) if self.load.is_shared() => {}
                Request::Step(_) => {
                    plain.redo();
                }
            }
        }
        let expected = plain.world().hash();
        let terrain = self.terrain;
        if self.load.is_shared() {
            self.run_until("the shared world is shown", |stage| stage.hash(terrain) == expected);
            self.settle();
        }
        assert_eq!(self.stage.hash(terrain), expected, "{what:?}: the world");
        let seams = self.stage.terrain(terrain).world().check_seams();
        assert!(seams.is_flawless(), "{what:?}: {seams:?}");
        self.stage.assert_whole(terrain, &format!("{what:?}"));
        self.check_entities(what);
    }

    /// No part belongs to nobody, and each is there once.
    pub(super) fn check_entities(&mut self, what: &dyn Debug) {
        let terrain = self.terrain;
        let world = self.stage.app.world_mut();
        let lonely = world.resource::<Lonely>().0;
        assert_eq!(lonely, 0, "{what:?}: tiles without a parent when they were added");
        let mut seen = world.query::<&bevy::camera::visibility::VisibilityClass>();
        let most = seen.iter(world).map(|class| class.len()).max();
        assert!(most <= Some(1), "{what:?}: parts that are seen twice");
        let mut parts = world.query::<(Option<&Tile>, Option<&Chunk>, Option<&Field>, &ChildOf)>();
        let (mut tiles, mut chunks, mut fields) = (Vec::new(), Vec::new(), 0);
        for (tile, chunk, field, parent) in parts.iter(world) {
            if let Some(&Tile { x, z, level }) = tile {
                assert_eq!(parent.parent(), terrain, "{what:?}: a tile of nobody");
                tiles.push((level, x, z));
            }
            if let Some(&Chunk { x, y, z }) = chunk {
                assert_eq!(parent.parent(), terrain, "{what:?}: a chunk of nobody");
                chunks.push((x, y, z));
            }
            fields += usize::from(field.is_some());
        }
        let lonely = |world: &mut World| {
            let mut lonely =
                world.query_filtered::<(), (Or<(With<Tile>, With<Chunk>, With<Field>)>, Without<ChildOf>)>();
            lonely.iter(world).count()
        };
        assert_eq!(lonely(world), 0, "{what:?}: parts without a parent");
        let all = (tiles.len(), chunks.len());
        tiles.sort_unstable();
        tiles.dedup();
        chunks.sort_unstable();
        chunks.dedup();
        assert_eq!((tiles.len(), chunks.len()), all, "{what:?}: parts that are there twice");
        let model = self.stage.terrain(terrain).world();
        let expected: usize = model.fields().map(|(_, fields)| fields.len()).sum();
        assert_eq!(fields, expected, "{what:?}: fields");
    }

    /// Ends the life: nothing is left of it.
    pub(super) fn end(mut self) {
        #[cfg(feature = "store")]
        self.note_saved();
        let world = self.stage.app.world_mut();
        let parent = world.get::<ChildOf>(self.terrain).map(ChildOf::parent);
        world.despawn(parent.unwrap_or(self.terrain));
        self.stage.frames(6);
        assert!(self.stage.meshes() <= self.before.1, "meshes are left");
        let world = self.stage.app.world_mut();
        let mut rest = world.query_filtered::<(), (
            Or<(With<Tile>, With<Chunk>, With<Field>, With<Terrain>)>,
            Allow<Disabled>,
        )>();
        assert_eq!(rest.iter(world).count(), 0, "entities are left");
        let (after, before) = (entities(&mut self.stage), self.before.0);
        assert!(after <= before + FEW, "{after} entities, {before} before");
        // An app that ends waits for worlds that are being closed.
        self.stage.app = App::empty();
        #[cfg(feature = "store")]
        self.check_saved();
    }
}

#[cfg(feature = "store")]
impl Drop for Saves {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.folder));
    }
}

pub(super) fn levels() -> LevelsOfDetail {
    LevelsOfDetail { cell_pixels: 40.0, error_pixels: 1.0, ..default() }
}

pub(super) fn is_ready(stage: &mut Stage) -> bool {
    use bevy::ecs::system::RunSystemOnce;
    let ask = |terrains: Terrains| terrains.is_ready(Vec3::NEG_INFINITY, Vec3::INFINITY);
    stage.app.world_mut().run_system_once(ask).expect("it can be asked")
}

pub(super) fn entities(stage: &mut Stage) -> usize {
    let world = stage.app.world_mut();
    world
        .query_filtered::<(), (Without<bevy::ecs::observer::Observer>, Allow<Disabled>)>()
        .iter(world)
        .count()
}

/// Entities that Bevy itself may add while an app runs, for resources say.
pub(super) const FEW: usize = 8;
