//! Devices that can't be opened, or not be trusted.

use super::super::device::{Device, Fault, HostMemory, Kernel, Mark};
use super::super::emulator::skip;
use super::*;

#[test]
fn a_device_that_can_not_be_opened_is_no_device() {
    for fault in [
        Fault::NoDriver,
        Fault::NoDevice("CUDA_ERROR_NO_DEVICE".into()),
        Fault::OldDevice(6, 1),
        Fault::Refused("CUDA_ERROR_UNSUPPORTED_PTX_VERSION".into()),
        Fault::Memory(1 << 30),
    ] {
        let text = fault.to_string();
        let engine = Engine::from_cuda(Cuda::open_with(false, None, self_test::FULL, move || Err(fault)));
        assert_eq!(engine.wait(Duration::from_secs(9)), EngineState::Lost(text));
        assert!(engine.figures().trial.is_zero());
        compare(&mut Rng::with_seed(3), 3, &engine);
    }
}

#[test]
#[ignore = "every engine does the same when it opens a card; the emulator takes 16 s"]
fn a_device_passes_the_whole_trial() {
    let Some(device) = device() else { return };
    let name = device.name();
    let engine = Engine::from_cuda(Cuda::open_with(false, None, self_test::FULL, || Ok(device)));
    assert_eq!(engine.wait(Duration::from_secs(600)), EngineState::Cuda(name));
}

/// What the test below starts in a process of its own.
#[test]
#[ignore = "looks at the machine's driver"]
fn tell_what_the_driver_says() {
    let engine = Engine::new(crate::backend::Backend::Cuda);
    println!("state: {:?}", engine.wait(Duration::from_secs(30)));
    compare(&mut Rng::with_seed(3), 3, &engine);
}

/// A driver's library that knows errors only, each with its code.
#[test]
fn a_driver_without_a_device_is_no_device() {
    let folder = std::env::temp_dir().join(format!("burrow-driver-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the library");
    for (code, name) in [(100, "CUDA_ERROR_NO_DEVICE"), (35, "CUDA_ERROR_INSUFFICIENT_DRIVER")] {
        let source = format!(
            "int cuInit(unsigned flags) {{ (void)flags; return {code}; }}\n\
             int cuGetErrorName(int code, const char** name) {{ (void)code; *name = \"{name}\"; return 0; }}\n"
        );
        std::fs::write(folder.join("driver.c"), source).expect("a source file");
        let cc = std::process::Command::new("cc")
            .args(["-shared", "-fPIC", "-o", "libcuda.so", "driver.c"])
            .current_dir(&folder)
            .status();
        if !cc.is_ok_and(|status| status.success()) {
            skip("there is no C compiler for a driver's library");
            break;
        }
        std::fs::copy(folder.join("libcuda.so"), folder.join("libcuda.so.1")).expect("a copy");
        let said = std::process::Command::new(std::env::current_exe().expect("this test"))
            .args([
                "--exact",
                "backend::cuda::tests::drivers::tell_what_the_driver_says",
                "--ignored",
                "--nocapture",
            ])
            .env("LD_LIBRARY_PATH", &folder)
            .output()
            .expect("this test can be started again");
        let text = String::from_utf8_lossy(&said.stdout).into_owned();
        assert!(said.status.success(), "{text}{}", String::from_utf8_lossy(&said.stderr));
        assert!(text.contains(&format!("Lost(\"there is no CUDA device: {name}\")")), "{text}");
    }
    std::fs::remove_dir_all(&folder).expect("the folder can go");
}

#[test]
fn a_device_that_computes_something_else_is_not_trusted() {
    /// Turns a bit of every read.
    struct Liar(Box<dyn Device>);
    impl Device for Liar {
        fn name(&self) -> String {
            self.0.name()
        }
        fn free_memory(&mut self) -> usize {
            self.0.free_memory()
        }
        fn alloc(&mut self, bytes: usize) -> Result<u64, Fault> {
            self.0.alloc(bytes)
        }
        fn free(&mut self, address: u64) {
            self.0.free(address);
        }
        fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
            self.0.alloc_host(bytes)
        }
        fn upload(
            &mut self,
            from: &dyn HostMemory,
            bytes: std::ops::Range<usize>,
            to: u64,
        ) -> Result<(), Fault> {
            self.0.upload(from, bytes, to)
        }
        fn download(
            &mut self,
            from: u64,
            to: &mut dyn HostMemory,
            bytes: std::ops::Range<usize>,
        ) -> Result<(), Fault> {
            self.0.download(from, to, bytes.clone())?;
            // The last bit of a density, of a normal or of a hash.
            if let Some(byte) = to.bytes_of_mut(bytes).and_then(|bytes| bytes.get_mut(512)) {
                *byte ^= 1;
            }
            Ok(())
        }
        fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault> {
            self.0.copy(from, to, bytes)
        }
        fn launch(&mut self, kernel: Kernel, blocks: u32, params: &[u8]) -> Result<(), Fault> {
            self.0.launch(kernel, blocks, params)
        }
        fn mark(&mut self) -> Result<Box<dyn Mark>, Fault> {
            self.0.mark()
        }
        fn wait(&mut self) -> Result<(), Fault> {
            self.0.wait()
        }
    }
    // A card writes to the host's memory without a copy, so only the emulator can be made to lie here.
    let Some(emulator) = Emulator::start() else { return };
    let engine = engine(Box::new(Liar(Box::new(emulator))), 64 << 20);
    assert_eq!(engine.state(), EngineState::Lost(Fault::SelfTest.to_string()));
}

#[test]
fn ground_that_can_not_be_made_gives_the_same_error_on_a_device() {
    let Some(device) = device() else { return };
    let (name, engine) = (device.name(), engine(device, 64 << 20));
    let good = NoiseHeights::default();
    for (width, noise) in [
        (0, good),
        (u32::MAX, good),
        (40, NoiseHeights { octaves: 17, ..good }),
        (40, NoiseHeights { scale: 0.5, ..good }),
        (40, NoiseHeights { base: f64::INFINITY, ..good }),
        (40, NoiseHeights { base: 32_768.0, ..good }),
    ] {
        let expected = Ground::from_noise(width, 30, &noise);
        assert!(expected.is_err());
        assert_eq!(engine.ground_from_noise(width, 30, &noise), expected);
    }
    // Refused heights are no fault of the device.
    assert_eq!(engine.state(), EngineState::Cuda(name));
}
