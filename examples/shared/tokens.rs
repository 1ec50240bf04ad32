//! Connect tokens: the holder of a server's key decides which players may connect, and under which numbers.
//!
//! A login service and the server have the key. The service checks who a player is, by a password or an account of a
//! shop, and sends a token over HTTPS. It names the player's number, the server and a time, and holds keys for one
//! encrypted connection. Nobody can make or change one without the key. To ban a player, the service issues no more
//! tokens.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::net::SocketAddr;
use std::path::Path;

use bevy::prelude::*;
use bevy_replicon_renet::netcode::{
    ClientAuthentication, ConnectToken, NETCODE_KEY_BYTES, ServerAuthentication, generate_random_bytes,
};

use super::party;

/// Seconds in which a token has to be used.
const EXPIRES: u64 = 30;

/// Seconds without a packet after which a connection is over.
const TIMEOUT: i32 = 15;

/// The key of a server. It never leaves the server and the login service.
#[derive(Clone, Copy)]
pub struct Key([u8; NETCODE_KEY_BYTES]);

impl Key {
    /// A new key.
    pub fn random() -> Self {
        Self(generate_random_bytes())
    }

    /// The key in a file, as hexadecimal digits; a new one if there is no such file.
    ///
    /// # Errors
    /// When the file can't be read or written, or holds something else.
    pub fn of_file(path: &Path) -> Result<Self> {
        if !path.exists() {
            let key = Self::random();
            key.write(path)?;
            return Ok(key);
        }
        let text = fs::read_to_string(path)?;
        let mut key = [0; NETCODE_KEY_BYTES];
        let digits = text.trim();
        let is_key = digits.len() == 2 * key.len() && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
        if !is_key {
            return Err(
                format!("{} holds no key of {} hexadecimal digits", path.display(), 2 * key.len()).into()
            );
        }
        for (byte, at) in key.iter_mut().zip((0..).step_by(2)) {
            *byte = u8::from_str_radix(&digits[at..at + 2], 16)?;
        }
        Ok(Self(key))
    }

    fn write(&self, path: &Path) -> Result {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        let mut options = OpenOptions::new();
        options.write(true).create_new(true);
        // No other user of this machine may read it.
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let digits: String = self.0.iter().map(|byte| format!("{byte:02x}")).collect();
        writeln!(options.open(path)?, "{digits}")?;
        Ok(())
    }

    /// The server's authentication.
    pub fn server(&self) -> ServerAuthentication {
        ServerAuthentication::Secure { private_key: self.0 }
    }

    /// A token for a player of this number. The player tries these addresses one after the other; the server's has to
    /// be among them.
    ///
    /// # Errors
    /// When there are too many addresses.
    pub fn issue(&self, player: u64, servers: Vec<SocketAddr>) -> Result<ClientAuthentication> {
        let connect_token = ConnectToken::generate(
            party::now()?,
            party::PROTOCOL,
            EXPIRES,
            player,
            TIMEOUT,
            servers,
            None,
            &self.0,
        )?;
        Ok(ClientAuthentication::Secure { connect_token })
    }
}
