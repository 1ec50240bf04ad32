//! A bad network: packets between a server and its players are lost and late.

use std::collections::BinaryHeap;
use std::collections::HashMap;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use fastrand::Rng;

/// How bad it is.
#[derive(Clone, Copy, Debug)]
pub struct Weather {
    /// The share of packets that are lost, 0..=1.
    pub loss: f64,
    /// How late packets are in the mean, and by how much that varies.
    pub latency: Duration,
    pub jitter: Duration,
}

/// A packet on its way: the earliest first.
struct Packet {
    due: Instant,
    number: u64,
    bytes: Vec<u8>,
    /// Which socket sends it, and where to.
    from: usize,
    to: SocketAddr,
}

impl PartialEq for Packet {
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
    }
}

impl Eq for Packet {}

impl PartialOrd for Packet {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Packet {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (other.due, other.number).cmp(&(self.due, self.number))
    }
}

/// Passes packets on until it is dropped.
pub struct Proxy {
    /// Where players connect to.
    pub address: SocketAddr,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<(u64, u64)>>,
}

impl Proxy {
    /// A proxy before this server.
    pub fn new(server: SocketAddr, weather: Weather) -> std::io::Result<Self> {
        let front = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        front.set_nonblocking(true)?;
        let address = front.local_addr()?;
        let is_over = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&is_over);
        let thread = std::thread::spawn(move || {
            let mut road = Road { sockets: vec![front], players: HashMap::new(), ..Road::default() };
            while !ended.load(Ordering::Relaxed) {
                road.pass(server, weather);
                std::thread::sleep(Duration::from_micros(500));
            }
            (road.number, road.lost)
        });
        Ok(Self { address, is_over, thread: Some(thread) })
    }

    /// Ends it; returns how many packets came, and how many of them were lost.
    pub fn finish(mut self) -> (u64, u64) {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}

#[derive(Default)]
struct Road {
    /// The one that players send to, then one for each player.
    sockets: Vec<UdpSocket>,
    players: HashMap<SocketAddr, usize>,
    way: BinaryHeap<Packet>,
    number: u64,
    lost: u64,
    rng: Rng,
}

impl Road {
    fn pass(&mut self, server: SocketAddr, weather: Weather) {
        let mut buffer = [0; 2048];
        let mut at = 0;
        while at < self.sockets.len() {
            while let Ok((length, from)) = self.sockets[at].recv_from(&mut buffer) {
                let bytes = buffer[..length].to_vec();
                if at == 0 {
                    let Some(socket) = self.socket_of(from) else { continue };
                    self.send_later(socket, server, bytes, weather);
                } else if let Some((player, _)) = self.players.iter().find(|(_, socket)| **socket == at) {
                    self.send_later(0, *player, bytes, weather);
                }
            }
            at += 1;
        }
        while let Some(packet) = self.way.peek() {
            if packet.due > Instant::now() {
                return;
            }
            if let Some(Packet { bytes, from, to, .. }) = self.way.pop() {
                // One that can't be sent is lost.
                let _ = self.sockets[from].send_to(&bytes, to);
            }
        }
    }

    /// The socket that stands for a player before the server.
    fn socket_of(&mut self, player: SocketAddr) -> Option<usize> {
        if let Some(&socket) = self.players.get(&player) {
            return Some(socket);
        }
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).ok()?;
        socket.set_nonblocking(true).ok()?;
        self.sockets.push(socket);
        self.players.insert(player, self.sockets.len() - 1);
        Some(self.sockets.len() - 1)
    }

    fn send_later(&mut self, from: usize, to: SocketAddr, bytes: Vec<u8>, weather: Weather) {
        self.number += 1;
        if self.rng.f64() < weather.loss {
            self.lost += 1;
            return;
        }
        let late =
            weather.latency.as_secs_f64() + (self.rng.f64() * 2.0 - 1.0) * weather.jitter.as_secs_f64();
        let due = Instant::now() + Duration::from_secs_f64(late.max(0.0));
        self.way.push(Packet { due, number: self.number, bytes, from, to });
    }
}
