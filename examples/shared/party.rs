//! Connections over UDP, for programs whose players dig together.
//!
//! They are not encrypted, and anybody may join under any number: for machines of friends. Games use the tokens of
//! `netcode`.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::time::{Duration, SystemTime};

use bevy::prelude::*;
use bevy_replicon::prelude::RepliconChannels;
use bevy_replicon_renet::netcode::{
    ClientAuthentication, NetcodeClientTransport, NetcodeServerTransport, ServerAuthentication, ServerConfig,
};
use bevy_replicon_renet::renet::ConnectionConfig;
use bevy_replicon_renet::{RenetChannelsExt, RenetClient, RenetServer};

/// The port that hosts listen on.
pub const PORT: u16 = 5100;

/// Programs with another number do not understand each other.
const PROTOCOL: u64 = 0x6275_7272_6f77;

/// Bytes a second that are sent to each player at most.
const BYTES: u64 = 4 << 20;

fn config(world: &World) -> ConnectionConfig {
    let channels = world.resource::<RepliconChannels>();
    ConnectionConfig {
        available_bytes_per_tick: BYTES / 60,
        server_channels_config: channels.server_configs(),
        client_channels_config: channels.client_configs(),
    }
}

/// Listens for a limited number of players. Everything that is replicated has to be registered.
///
/// # Errors
/// When the address is taken.
pub fn listen(world: &mut World, address: SocketAddr, players: usize) -> Result<SocketAddr> {
    let socket = UdpSocket::bind(address)?;
    let local = socket.local_addr()?;
    let config = ServerConfig {
        current_time: now()?,
        max_clients: players,
        protocol_id: PROTOCOL,
        authentication: ServerAuthentication::Unsecure,
        public_addresses: vec![local],
    };
    let server = RenetServer::new(self::config(world));
    world.insert_resource(server);
    world.insert_resource(NetcodeServerTransport::new(config, socket)?);
    Ok(local)
}

/// Connects to a server, as the player of this number, and ends what was there before.
///
/// # Errors
/// When there is no network.
pub fn connect(world: &mut World, server: SocketAddr, player: u64) -> Result {
    // Replicon notices a connection when its resource is added, and not when it replaces another one.
    leave(world);
    let any = if server.ip().is_loopback() { Ipv4Addr::LOCALHOST } else { Ipv4Addr::UNSPECIFIED };
    let socket = UdpSocket::bind((any, 0))?;
    let authentication = ClientAuthentication::Unsecure {
        client_id: player,
        protocol_id: PROTOCOL,
        server_addr: server,
        user_data: None,
    };
    let client = RenetClient::new(config(world));
    world.insert_resource(client);
    world.insert_resource(NetcodeClientTransport::new(now()?, authentication, socket)?);
    Ok(())
}

/// Ends all connections.
pub fn leave(world: &mut World) {
    if let Some(mut client) = world.remove_resource::<NetcodeClientTransport>() {
        client.disconnect();
    }
    let transport = world.remove_resource::<NetcodeServerTransport>();
    if let (Some(mut transport), Some(mut server)) = (transport, world.get_resource_mut::<RenetServer>()) {
        transport.disconnect_all(&mut server);
    }
    world.remove_resource::<RenetClient>();
    world.remove_resource::<RenetServer>();
}

fn now() -> Result<Duration> {
    Ok(SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?)
}
