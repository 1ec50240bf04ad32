//! The script for `--together`: two players in one world, connected over UDP. The guest digs, the host builds, and both see the
//! same.

use std::net::{Ipv4Addr, UdpSocket};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::render::settings::RenderResources;
use bevy_burrow::prelude::*;
use bevy_burrow::together::SharedTerrain;

use crate::Options;
use crate::film::places::{Hillside, Places, flat};
use crate::film::report::EditLog;
use crate::film::scripted_brushes;
use crate::film::studio::{PATIENCE, Studio};
use crate::party::connection::Address;
use crate::party::players::PlayerInfo;
use crate::ui::settings::Settings;
use crate::world::landscape::{CONCRETE, NewGame};
use crate::world::saves::PlayedWorld;

/// Steps of the tunnel that the guest digs.
const STEPS: usize = 6;

/// Plays the script. It fails if the players see different worlds, or a picture is missing.
pub fn run(options: &Options, renderer: Option<RenderResources>) -> ExitCode {
    match play(options, renderer) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("The script failed: {error}");
            ExitCode::FAILURE
        }
    }
}

fn play(options: &Options, renderer: Option<RenderResources>) -> Result {
    let free_port = || Ok::<_, BevyError>(UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?.port());
    let port = options.host.map_or_else(free_port, Ok)?;
    let join = Some(Address((Ipv4Addr::LOCALHOST, port).into(), 0));
    let mut host = Studio::open(&Options { host: Some(port), ..options.clone() }, renderer)?;
    let guest = Options { host: None, join, world: None, ..options.clone() };
    let guest = Studio::open_while(&guest, None, || host.wait(1))?;
    let mut two = Two { host, guest };
    two.host.world().resource_mut::<Settings>().name = "Ann".into();
    two.guest.world().resource_mut::<Settings>().name = "Bob".into();

    two.until("the guest has joined", |two| Ok(two.guest.shared()?.has_joined()))?;
    two.until("both know each other", |two| Ok(two.host.players() == 2 && two.guest.players() == 2))?;
    let places: Places = two.host.resource();
    let hillside = places.hillside;
    two.guest_digs(&hillside)?;
    two.host_builds(&hillside)?;
    two.until("both see the same", Two::agree)?;
    let (number, hash) = two.guest.state()?;
    println!("after {number} edits both see the world {hash:#018x}");
    two.host.shoot("1_guest")?;
    for picture in &two.host.pictures {
        println!("picture {}", picture.display());
    }

    two.host_begins_anew()?;
    two.guest.world().write_message(AppExit::Success);
    two.until("the guest has gone", |two| Ok(two.host.players() == 1))
}

/// What this script asks of a player's game.
impl Studio {
    fn shared(&mut self) -> Result<&SharedTerrain> {
        let world = self.world();
        let mut terrains = world.query::<&SharedTerrain>();
        Ok(terrains.single(world)?)
    }

    /// The number of the last edit, and the hash of what is shown.
    fn state(&mut self) -> Result<(u64, u64)> {
        Ok((self.shared()?.number(), self.terrain()?.world().hash()))
    }

    fn players(&mut self) -> usize {
        let world = self.world();
        world.query::<&PlayerInfo>().iter(world).count()
    }

    fn answered(&self) -> usize {
        self.resource::<EditLog>().answered()
    }
}

/// Two games, frame by frame in turns.
struct Two {
    host: Studio,
    guest: Studio,
}

impl Two {
    fn step(&mut self) {
        self.host.wait(1);
        self.guest.wait(1);
        std::thread::sleep(Duration::from_millis(1));
    }

    fn until(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> Result<bool>) -> Result {
        let start = Instant::now();
        while !is_so(self)? {
            if start.elapsed() > PATIENCE {
                return Err(format!("this did not happen: {what}").into());
            }
            self.step();
        }
        Ok(())
    }

    /// Whether everything is confirmed and both show the same world.
    fn agree(&mut self) -> Result<bool> {
        let is_settled = self.host.shared()?.pending() == 0 && self.guest.shared()?.pending() == 0;
        Ok(is_settled && self.host.state()? == self.guest.state()?)
    }

    /// Edits of a player, one after the other, while both play on.
    fn edit(&mut self, player: fn(&mut Self) -> &mut Studio, brushes: Vec<Brush>) -> Result {
        for brush in brushes {
            let answered = player(self).answered();
            player(self).world().write_message(brush);
            self.until("an edit is answered", |two| Ok(player(two).answered() > answered))?;
        }
        Ok(())
    }

    /// The host starts the game again, in a world that is not saved, and the guest returns automatically.
    fn host_begins_anew(&mut self) -> Result {
        let before = self.guest.state()?;
        *self.host.world().resource_mut::<PlayedWorld>() = PlayedWorld(None);
        self.host.world().trigger(NewGame);
        self.until("the guest loses the host", |two| Ok(two.guest.players() == 0))?;
        self.until("the guest comes back", |two| Ok(two.host.players() == 2 && two.guest.players() == 2))?;
        self.until("both see the new world", |two| {
            Ok(two.guest.shared()?.has_joined() && two.guest.state()?.1 != before.1 && two.agree()?)
        })?;
        println!("the host started again, and both see the world {:#018x}", self.guest.state()?.1);
        Ok(())
    }

    /// The guest goes to the hillside and digs into it.
    fn guest_digs(&mut self, hillside: &Hillside) -> Result {
        let Hillside { mouth, inward, .. } = *hillside;
        self.guest.move_to(mouth.xz() - inward * 9.0)?;
        self.guest.look_at(mouth + Vec3::Y * 2.0)?;
        self.guest.lamp(true);
        let tunnel = scripted_brushes::tunnel(hillside);
        let brushes = tunnel.into_iter().take(STEPS).map(|(brush, _)| brush).collect();
        self.edit(|two| &mut two.guest, brushes)
    }

    /// The host builds a pillar next to it, and looks at the guest.
    fn host_builds(&mut self, hillside: &Hillside) -> Result {
        let Hillside { mouth, inward, .. } = *hillside;
        let aside = inward.perp();
        self.host.move_to(mouth.xz() - inward * 16.0 + aside * 4.0)?;
        let foot = mouth - flat(inward) * 3.0 - flat(aside) * 7.0;
        let ground = self.host.land()?.height(foot.xz()).ok_or("the pillar would be outside the world")?;
        let pillar = Shape::capsule(foot.with_y(ground - 1.0), foot.with_y(ground + 5.0), 1.2);
        self.edit(|two| &mut two.host, vec![Brush::add(pillar, CONCRETE)])?;
        let guest = self.guest.feet()?;
        self.host.look_at(guest + Vec3::Y * 1.6 + flat(inward) * 2.0)?;
        (0..30).for_each(|_| self.step());
        Ok(())
    }
}
