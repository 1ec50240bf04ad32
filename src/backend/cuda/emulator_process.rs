//! A process that runs the kernels on the CPU, for tests without a GPU.

use std::io::{BufReader, BufWriter, Read, Write};
use std::ops::Range;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};

use super::device::{Device, DeviceResult, Fault, HostMemory, Launch, Mark};

/// The emulator process, which ends when this is dropped.
pub(super) struct Emulator {
    child: Child,
    input: BufWriter<ChildStdin>,
    output: BufReader<ChildStdout>,
}

/// A mark that has always passed: the emulator works synchronously.
struct Done;

impl Mark for Done {
    fn wait(&self) -> Result<(), Fault> {
        Ok(())
    }
}

/// Host memory that the emulator cannot access.
struct Plain {
    words: Vec<u128>,
    len: usize,
}

impl HostMemory for Plain {
    fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.len]
    }

    fn bytes_of(&self, range: Range<usize>) -> Option<&[u8]> {
        self.bytes().get(range)
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.len]
    }

    fn bytes_of_mut(&mut self, range: Range<usize>) -> Option<&mut [u8]> {
        self.bytes_mut().get_mut(range)
    }

    fn address(&self) -> Option<u64> {
        None
    }
}

/// Prints what is not tested and why. If `BURROW_REQUIRE` is set in the environment, the test fails instead, since
/// the output of passing tests is not read.
pub(super) fn skip(why: &str) {
    let is_required = std::env::var_os("BURROW_REQUIRE").is_some_and(|value| !value.is_empty());
    assert!(!is_required, "BURROW_REQUIRE is set, but {why}");
    println!("{why}");
}

/// Codes of requests.
const ALLOC: u64 = 1;
const FREE: u64 = 2;
const WRITE: u64 = 3;
const READ: u64 = 4;
const LAUNCH: u64 = 5;

impl Emulator {
    /// Builds the emulator if necessary and starts it. Without a C++ compiler it prints why the test is skipped,
    /// and returns `None`.
    pub fn start() -> Option<Self> {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/emulator.sh");
        let built = Command::new(script).stderr(Stdio::inherit()).output().expect("the script can be run");
        if built.status.code() == Some(2) {
            skip("there is no C++ compiler: kernels are not tested");
            return None;
        }
        assert!(built.status.success(), "the emulator can be built");
        let path = String::from_utf8(built.stdout).expect("a path");
        // Each process runs threads in its own order, which can be reproduced.
        static STARTED: AtomicU64 = AtomicU64::new(1);
        let fresh = || STARTED.fetch_add(1, Ordering::Relaxed).to_string();
        let shuffle = std::env::var("BURROW_EMULATOR_SHUFFLE").unwrap_or_else(|_| fresh());
        println!("BURROW_EMULATOR_SHUFFLE={shuffle}");
        let mut child = Command::new(path.trim())
            .env("BURROW_EMULATOR_SHUFFLE", shuffle)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the emulator can be started");
        let input = BufWriter::new(child.stdin.take().expect("piped"));
        let output = BufReader::new(child.stdout.take().expect("piped"));
        Some(Self { child, input, output })
    }

    fn ask(&mut self, words: &[u64]) -> Result<(), Fault> {
        self.send(bytemuck::cast_slice(words))
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        self.input.write_all(bytes).map_err(|error| Fault::Failed(error.to_string()))
    }

    fn receive(&mut self, bytes: &mut [u8]) -> Result<(), Fault> {
        let all = self.input.flush().and_then(|()| self.output.read_exact(bytes));
        all.map_err(|error| Fault::Failed(error.to_string()))
    }

    fn answer(&mut self) -> Result<u64, Fault> {
        let mut word = [0; 8];
        self.receive(&mut word)?;
        Ok(u64::from_le_bytes(word))
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Device for Emulator {
    fn name(&self) -> String {
        "emulator".into()
    }

    fn free_memory(&mut self) -> usize {
        1 << 30
    }

    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault> {
        self.ask(&[ALLOC, bytes.max(1) as u64])?;
        match self.answer()? {
            0 => Err(Fault::Memory(bytes)),
            address => Ok(address),
        }
    }

    fn free(&mut self, address: u64) {
        let _ = self.ask(&[FREE, address]);
    }

    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
        Ok(Box::new(Plain { words: vec![0; bytes.div_ceil(16)], len: bytes }))
    }

    unsafe fn upload(&mut self, from: &dyn HostMemory, bytes: Range<usize>, to: u64) -> DeviceResult {
        self.ask(&[WRITE, to, bytes.len() as u64])?;
        self.send(&from.bytes()[bytes])
    }

    unsafe fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> DeviceResult {
        self.ask(&[READ, from, bytes.len() as u64])?;
        let out_of_range = || Fault::Failed("copy out of range".into());
        self.receive(to.bytes_of_mut(bytes).ok_or_else(out_of_range)?)
    }

    unsafe fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault> {
        let mut all = vec![0; bytes];
        self.ask(&[READ, from, bytes as u64])?;
        self.receive(&mut all)?;
        self.ask(&[WRITE, to, bytes as u64])?;
        self.send(&all)
    }

    unsafe fn launch(&mut self, launch: Launch<'_>) -> Result<(), Fault> {
        let params = launch.params();
        self.ask(&[LAUNCH, launch.kernel() as u64, u64::from(launch.blocks()), params.len() as u64])?;
        self.send(params)?;
        match self.answer()? {
            0 => Ok(()),
            status => Err(Fault::Failed(format!("status {status}"))),
        }
    }

    fn mark(&mut self) -> Result<Box<dyn Mark>, Fault> {
        Ok(Box::new(Done))
    }

    fn wait(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}
