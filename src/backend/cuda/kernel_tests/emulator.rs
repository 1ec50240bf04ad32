//! The emulator of the device, a child process that runs the kernels on the CPU: `tools/emulator` says how it is spoken to.

use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use crate::backend::cuda::layout::Address;

/// The kernels, by their numbers.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kernel {
    Scatter,
    Edit,
    Mesh,
}

/// A device with memory of its own.
pub(super) struct Emulator {
    child: Child,
    /// `None` once it was told to end.
    requests: Option<BufWriter<ChildStdin>>,
    answers: BufReader<ChildStdout>,
}

impl Emulator {
    /// Builds the emulator if need be, and starts it; `None` where it can't be built: no C++ compiler, no Linux.
    ///
    /// `BURROW_EMULATOR` names another program that speaks the same.
    pub fn start() -> io::Result<Option<Self>> {
        let Some(program) = program()? else { return Ok(None) };
        let mut child = Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let (Some(requests), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(io::Error::other("the emulator has no pipes"));
        };
        let (requests, answers) = (Some(BufWriter::new(requests)), BufReader::new(answers));
        Ok(Some(Self { child, requests, answers }))
    }

    /// Allocates memory full of rubbish.
    pub fn allocate(&mut self, bytes: u64) -> io::Result<Address> {
        self.request(&[1, bytes])?;
        match self.answer()? {
            0 => Err(io::ErrorKind::OutOfMemory.into()),
            address => Ok(address),
        }
    }

    pub fn free(&mut self, address: Address) -> io::Result<()> {
        self.request(&[2, address])
    }

    pub fn write(&mut self, address: Address, bytes: &[u8]) -> io::Result<()> {
        self.request(&[3, address, bytes.len() as u64])?;
        self.send(bytes)
    }

    pub fn read(&mut self, address: Address, bytes: &mut [u8]) -> io::Result<()> {
        self.request(&[4, address, bytes.len() as u64])?;
        self.flush()?;
        self.answers.read_exact(bytes)
    }

    pub fn launch(&mut self, kernel: Kernel, blocks: usize, params: &[u8]) -> io::Result<()> {
        self.request(&[5, kernel as u64, blocks as u64, params.len() as u64])?;
        self.send(params)?;
        match self.answer()? {
            0 => Ok(()),
            status => Err(io::Error::other(format!("{kernel:?} failed with {status}"))),
        }
    }

    pub fn fill(&mut self, address: Address, bytes: u64, byte: u8) -> io::Result<()> {
        self.request(&[6, address, bytes, byte.into()])
    }

    fn request(&mut self, words: &[u64]) -> io::Result<()> {
        words.iter().try_for_each(|word| self.send(&word.to_le_bytes()))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.requests.as_mut().map_or(Ok(()), |requests| requests.write_all(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.requests.as_mut().map_or(Ok(()), Write::flush)
    }

    fn answer(&mut self) -> io::Result<u64> {
        self.flush()?;
        let mut word = [0; 8];
        self.answers.read_exact(&mut word)?;
        Ok(u64::from_le_bytes(word))
    }
}

impl Drop for Emulator {
    /// It ends where its requests do.
    fn drop(&mut self) {
        self.requests = None;
        let _ = self.child.wait();
    }
}

/// Where the emulator is, built just now if need be.
fn program() -> io::Result<Option<PathBuf>> {
    if let Some(named) = std::env::var_os("BURROW_EMULATOR") {
        return Ok(Some(named.into()));
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/emulator.sh");
    let built = match Command::new("sh").arg(script).stderr(Stdio::inherit()).output() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        built => built?,
    };
    match built.status.code() {
        Some(0) => Ok(Some(String::from_utf8_lossy(&built.stdout).trim().into())),
        // It said why.
        Some(2) => Ok(None),
        _ => Err(io::Error::other("tools/emulator.sh failed")),
    }
}
