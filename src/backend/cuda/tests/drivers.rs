//! Opening a GPU: missing drivers and devices, the choice of a GPU, waiting for it, and wrong results.

use super::super::device::{Device, DeviceResult, Fault, HostMemory, Launch, Mark, forward};
use super::super::emulator_process::skip;
use super::*;
use std::ops::Range;

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
        let engine =
            Engine::from_cuda(Cuda::with_device(false, limits(0), self_test::FULL, move |_| Err(fault)));
        assert_eq!(engine.wait(Duration::from_secs(9)), EngineState::Lost(text));
        assert!(engine.figures().opening.is_zero());
        compare(&mut Rng::with_seed(3), 3, &engine);
    }
}

#[test]
#[ignore = "every engine runs this test when it opens a GPU; the emulator takes 16 s"]
fn a_device_passes_the_whole_self_test() {
    let Some(device) = device() else { return };
    let name = device.name();
    let engine =
        Engine::from_cuda(Cuda::with_device(false, limits(256 << 20), self_test::FULL, |_| Ok(device)));
    assert_eq!(engine.wait(Duration::from_secs(600)), EngineState::Cuda(name));
}

/// Runs in a separate process, started by the test below.
#[test]
#[ignore = "looks at the machine's driver"]
fn print_what_the_driver_reports() {
    let engine = Engine::new(crate::backend::Backend::Cuda);
    println!("state: {:?}", engine.wait(Duration::from_secs(30)));
    compare(&mut Rng::with_seed(3), 3, &engine);
}

/// Compiles a driver library, and runs an ignored test of this file in a process that loads it. Returns the test's
/// output, or `None` without a C compiler.
fn with_driver(name: &str, source: &str, test: &str) -> Option<String> {
    let folder = std::env::temp_dir().join(format!("burrow-driver-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the library");
    std::fs::write(folder.join("driver.c"), source).expect("a source file");
    let cc = std::process::Command::new("cc")
        .args(["-shared", "-fPIC", "-o", "libcuda.so", "driver.c"])
        .current_dir(&folder)
        .status();
    if !cc.is_ok_and(|status| status.success()) {
        skip("there is no C compiler for a driver's library");
        return None;
    }
    std::fs::copy(folder.join("libcuda.so"), folder.join("libcuda.so.1")).expect("a copy");
    let test = format!("backend::cuda::tests::drivers::{test}");
    let said = std::process::Command::new(std::env::current_exe().expect("this test"))
        .args(["--exact", &test, "--ignored", "--nocapture"])
        .env("LD_LIBRARY_PATH", &folder)
        .output()
        .expect("this test can be started again");
    let text = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.status.success(), "{text}{}", String::from_utf8_lossy(&said.stderr));
    std::fs::remove_dir_all(&folder).expect("the folder can go");
    Some(text)
}

#[test]
fn a_driver_without_a_device_is_no_device() {
    for (code, name) in [(100, "CUDA_ERROR_NO_DEVICE"), (35, "CUDA_ERROR_INSUFFICIENT_DRIVER")] {
        // A library that only returns this error, and knows its name.
        let source = format!(
            "int cuInit(unsigned flags) {{ (void)flags; return {code}; }}\n\
             int cuGetErrorName(int code, const char** name) {{ (void)code; *name = \"{name}\"; return 0; }}\n"
        );
        let Some(text) = with_driver(name, &source, "print_what_the_driver_reports") else { return };
        assert!(text.contains(&format!("Lost(\"there is no CUDA device: {name}\")")), "{text}");
    }
}

/// Runs in a separate process, started by the test below.
#[test]
#[ignore = "needs the stand-in driver with three GPUs"]
fn open_each_of_three_gpus() {
    let open = |gpu: &GpuChoice, suggested: Option<&GpuChoice>| match Gpu::open(gpu, suggested) {
        Ok(gpu) => Ok(gpu.name()),
        Err(Fault::NoDevice(why)) => Err(why),
        Err(fault) => panic!("{fault}"),
    };
    let bus = |id: &str| GpuChoice::PciBusId(id.into());
    let default = GpuChoice::Default;
    for number in 0..3u32 {
        let name = Ok(format!("gpu {number}"));
        let all = [GpuChoice::Ordinal(number), GpuChoice::Uuid([70 + number as u8; 16])];
        for gpu in all.into_iter().chain([bus(&format!("0000:0{}:00.0", number + 1))]) {
            assert_eq!(open(&gpu, None), name);
            // The suggestion is used only if no GPU was chosen.
            assert_eq!(open(&gpu, Some(&GpuChoice::Ordinal(1))), name);
            assert_eq!(open(&default, Some(&gpu)), name);
        }
    }
    let others = [GpuChoice::Ordinal(3), GpuChoice::Ordinal(u32::MAX), GpuChoice::Uuid([9; 16])];
    for gpu in others.into_iter().chain(["0000:09:00.0", "", "anywhere", "0000:01:00.0\0"].map(bus)) {
        assert!(open(&gpu, None).is_err_and(|why| why.contains("not one of CUDA's")), "{gpu:?}");
        assert_eq!(open(&default, Some(&gpu)), Ok("gpu 0".into()));
    }
    assert_eq!(open(&default, None), Ok("gpu 0".into()));
}

#[test]
fn a_gpu_is_chosen_by_ordinal_by_uuid_and_by_its_bus_address() {
    with_driver("cards", include_str!("driver.c"), "open_each_of_three_gpus");
}

/// CPU time of this thread, where the system provides it.
fn cpu_time() -> Option<Duration> {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    stat.split(' ').next()?.parse().ok().map(Duration::from_nanos)
}

/// Runs in a separate process, started by the test below.
#[test]
#[ignore = "needs the stand-in driver that answers slowly"]
fn wait_for_a_slow_gpu() {
    let mut gpu = Gpu::open(&GpuChoice::Default, None).expect("a GPU");
    // Only the waits are timed. Other load makes them longer, but this thread no busier.
    let (Some(before), start) = (cpu_time(), std::time::Instant::now()) else { return };
    gpu.wait().expect("the GPU works");
    let mark = gpu.mark().expect("a mark");
    mark.wait().expect("the GPU works");
    let (took, busy) = (start.elapsed(), cpu_time().expect("available above") - before);
    // A spinning thread would be busy all the time.
    assert!(took > Duration::from_millis(120) && busy < took / 4, "{busy:?} busy of {took:?}");
}

#[test]
fn a_thread_that_waits_for_a_slow_gpu_sleeps() {
    with_driver("slow", include_str!("driver.c"), "wait_for_a_slow_gpu");
}

#[test]
fn a_device_that_computes_something_else_is_not_trusted() {
    /// A device that flips a bit in every download.
    struct BitFlipper(Box<dyn Device>);
    impl Device for BitFlipper {
        forward!(0: name free_memory alloc free alloc_host upload copy launch mark wait);
        unsafe fn download(
            &mut self,
            from: u64,
            to: &mut dyn HostMemory,
            bytes: Range<usize>,
        ) -> DeviceResult {
            // SAFETY: the caller promises the same.
            unsafe { self.0.download(from, to, bytes.clone()) }?;
            // The last bit of a density, a normal or a hash.
            if let Some(byte) = to.bytes_of_mut(bytes).and_then(|bytes| bytes.get_mut(512)) {
                *byte ^= 1;
            }
            Ok(())
        }
    }
    // A GPU writes to host memory without a copy, so only the emulator can be made to return wrong bits.
    let Some(emulator) = Emulator::start() else { return };
    let engine = engine(Box::new(BitFlipper(Box::new(emulator))), 64 << 20);
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
    // Rejected heights are not a fault of the device.
    assert_eq!(engine.state(), EngineState::Cuda(name));
}
