//! Vulkan's side of a shared buffer: memory that can be exported, and barriers that hand it to CUDA and back.

use std::ops::{Deref, Range};
use std::os::fd::{FromRawFd, OwnedFd};

use ash::{khr, vk};
use wgpu::hal::{api::Vulkan, vulkan::Device as HalDevice};

use super::InteropError;

/// How CUDA takes memory over.
const HANDLE: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;

/// What the buffer may be used for, in wgpu's words and in Vulkan's.
const USAGES: wgpu::BufferUsages =
    wgpu::BufferUsages::VERTEX.union(wgpu::BufferUsages::INDEX).union(wgpu::BufferUsages::COPY_SRC);
const VK_USAGES: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::VERTEX_BUFFER.as_raw()
        | vk::BufferUsageFlags::INDEX_BUFFER.as_raw()
        | vk::BufferUsageFlags::TRANSFER_SRC.as_raw(),
);

fn failed(error: vk::Result) -> InteropError {
    InteropError::Vulkan(error.to_string())
}

/// The Vulkan device below.
fn hal(device: &wgpu::Device) -> Result<impl Deref<Target = HalDevice>, InteropError> {
    // SAFETY: no one who gets this destroys the device's handle.
    unsafe { device.as_hal::<Vulkan>() }.ok_or(InteropError::NotVulkan)
}

/// Which card the device is, where it can share memory.
pub(super) fn uuid(device: &wgpu::Device) -> Result<[u8; 16], InteropError> {
    let device = hal(device)?;
    let shared = device.shared_instance();
    let instance = shared.raw_instance();
    let card = device.raw_physical_device();
    // SAFETY: the card is the instance's.
    let version = unsafe { instance.get_physical_device_properties(card) }.api_version;
    if version.min(shared.instance_api_version()) < vk::API_VERSION_1_1 {
        return Err(InteropError::CannotShare("it is older than 1.1"));
    }
    if !device.enabled_device_extensions().contains(&khr::external_memory_fd::NAME) {
        return Err(InteropError::CannotShare("VK_KHR_external_memory_fd is missing"));
    }
    let mut id = vk::PhysicalDeviceIDProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut id);
    // SAFETY: the card is the instance's, and both are of Vulkan 1.1, which has the call and the struct.
    unsafe { instance.get_physical_device_properties2(card, &mut properties) };
    Ok(id.device_uuid)
}

/// A Vulkan buffer with memory of its own that may be exported; not wgpu's yet.
pub(super) struct SharedMemory {
    device: ash::Device,
    instance: ash::Instance,
    /// Keeps both alive.
    _device: wgpu::Device,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    allocated: u64,
}

impl Drop for SharedMemory {
    fn drop(&mut self) {
        // SAFETY: the device lives, and nobody has used either of them there. Null handles are ignored.
        unsafe {
            self.device.destroy_buffer(self.buffer, None);
            self.device.free_memory(self.memory, None);
        }
    }
}

impl SharedMemory {
    /// So many bytes, more than none.
    pub fn new(device: &wgpu::Device, bytes: u64) -> Result<Self, InteropError> {
        let hal = hal(device)?;
        let instance = hal.shared_instance().raw_instance();
        let card = hal.raw_physical_device();
        let query = vk::PhysicalDeviceExternalBufferInfo::default().usage(VK_USAGES).handle_type(HANDLE);
        let mut answer = vk::ExternalBufferProperties::default();
        // SAFETY: the card is the instance's, and both are of Vulkan 1.1: `uuid` has looked.
        unsafe { instance.get_physical_device_external_buffer_properties(card, &query, &mut answer) };
        let features = answer.external_memory_properties.external_memory_features;
        if !features.contains(vk::ExternalMemoryFeatureFlags::EXPORTABLE) {
            return Err(InteropError::CannotShare("buffers can't be exported"));
        }
        if features.contains(vk::ExternalMemoryFeatureFlags::DEDICATED_ONLY) {
            return Err(InteropError::CannotShare("only dedicated memory can be exported"));
        }
        let mut own = Self {
            device: hal.raw_device().clone(),
            instance: instance.clone(),
            _device: device.clone(),
            buffer: vk::Buffer::null(),
            memory: vk::DeviceMemory::null(),
            allocated: 0,
        };
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(HANDLE);
        let info = vk::BufferCreateInfo::default()
            .size(bytes)
            .usage(VK_USAGES)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .push_next(&mut external);
        // SAFETY: the size is not zero, and such buffers can be exported.
        own.buffer = unsafe { own.device.create_buffer(&info, None) }.map_err(failed)?;
        // SAFETY: the buffer was just made by this device.
        let needs = unsafe { own.device.get_buffer_memory_requirements(own.buffer) };
        // SAFETY: the card is the instance's.
        let types = unsafe { instance.get_physical_device_memory_properties(card) };
        let is_local = |number: &u32| {
            let flags = types.memory_types_as_slice().get(*number as usize).map(|kind| kind.property_flags);
            needs.memory_type_bits >> number & 1 == 1
                && flags.is_some_and(|flags| flags.contains(vk::MemoryPropertyFlags::DEVICE_LOCAL))
        };
        let kind = (0..types.memory_type_count).find(is_local);
        let kind = kind.ok_or(InteropError::CannotShare("no memory of the card fits"))?;
        let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(HANDLE);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(kind)
            .push_next(&mut export);
        // SAFETY: the type is one of the card's.
        own.memory = unsafe { own.device.allocate_memory(&info, None) }.map_err(failed)?;
        own.allocated = needs.size;
        // SAFETY: both were just made, for each other.
        unsafe { own.device.bind_buffer_memory(own.buffer, own.memory, 0) }.map_err(failed)?;
        Ok(own)
    }

    /// How many bytes the memory has: at least as many as the buffer.
    pub fn allocated(&self) -> u64 {
        self.allocated
    }

    /// A descriptor of the memory, which owns a reference to it.
    pub fn descriptor(&self) -> Result<OwnedFd, InteropError> {
        let info = vk::MemoryGetFdInfoKHR::default().memory(self.memory).handle_type(HANDLE);
        let exports = khr::external_memory_fd::Device::new(&self.instance, &self.device);
        // SAFETY: the memory was allocated to be exported so, and the extension is enabled: `uuid` has looked.
        let descriptor = unsafe { exports.get_memory_fd(&info) }.map_err(failed)?;
        // SAFETY: the descriptor was just made for the caller, who has to close it.
        Ok(unsafe { OwnedFd::from_raw_fd(descriptor) })
    }

    /// Makes it wgpu's. It must hold something by now, and be `bytes` long.
    pub fn into_buffer(
        mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        bytes: u64,
    ) -> Result<SharedBuffer, InteropError> {
        let family = hal(device)?.queue_family_index();
        let raw = std::mem::take(&mut self.buffer);
        let memory = std::mem::take(&mut self.memory);
        // SAFETY: nobody else has the handles: this owner has just let go of them. The buffer fills its memory from the
        // start. It is never mapped: its usages have no mapping.
        let own = unsafe { wgpu::hal::vulkan::Buffer::from_raw_managed(raw, memory, 0, self.allocated) };
        let label = Some("shared with CUDA");
        let descriptor =
            wgpu::BufferDescriptor { label, size: bytes, usage: USAGES, mapped_at_creation: false };
        // SAFETY: the buffer is this device's, as long as described and usable as described; CUDA has filled it, and it
        // is not empty.
        let buffer = unsafe { device.create_buffer_from_hal::<Vulkan>(own, &descriptor) };
        Ok(SharedBuffer { device: device.clone(), queue: queue.clone(), family, raw, buffer, last: None })
    }
}

/// A wgpu buffer that is handed to CUDA and back.
pub(super) struct SharedBuffer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    family: u32,
    /// Of `buffer`, which owns it.
    raw: vk::Buffer,
    buffer: wgpu::Buffer,
    /// The last barrier. wgpu does not know that it uses the buffer.
    last: Option<wgpu::SubmissionIndex>,
}

impl Drop for SharedBuffer {
    fn drop(&mut self) {
        let _ = self.wait();
    }
}

impl SharedBuffer {
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Takes it away from the queue, and waits until that has happened: everything submitted before is done then.
    pub fn release(&mut self) -> Result<(), InteropError> {
        let barrier = vk::BufferMemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::MEMORY_READ)
            .src_queue_family_index(self.family)
            .dst_queue_family_index(vk::QUEUE_FAMILY_EXTERNAL);
        let stages = [vk::PipelineStageFlags::ALL_COMMANDS, vk::PipelineStageFlags::BOTTOM_OF_PIPE];
        self.submit(barrier, stages)?;
        self.wait()
    }

    /// Waits for the last barrier.
    fn wait(&mut self) -> Result<(), InteropError> {
        let Some(last) = self.last.take() else { return Ok(()) };
        let wait = wgpu::PollType::Wait { submission_index: Some(last), timeout: None };
        let polled = self.device.poll(wait);
        polled.map(drop).map_err(|error| InteropError::Vulkan(error.to_string()))
    }

    /// Gives it to the queue; whatever is submitted afterwards sees what was written.
    pub fn acquire(&mut self) -> Result<(), InteropError> {
        let barrier = vk::BufferMemoryBarrier::default()
            .dst_access_mask(vk::AccessFlags::MEMORY_READ)
            .src_queue_family_index(vk::QUEUE_FAMILY_EXTERNAL)
            .dst_queue_family_index(self.family);
        let stages = [vk::PipelineStageFlags::TOP_OF_PIPE, vk::PipelineStageFlags::ALL_COMMANDS];
        self.submit(barrier, stages)
    }

    /// Submits a barrier over the whole buffer.
    fn submit(
        &mut self,
        barrier: vk::BufferMemoryBarrier,
        [before, after]: [vk::PipelineStageFlags; 2],
    ) -> Result<(), InteropError> {
        let barrier = barrier.buffer(self.raw).offset(0).size(vk::WHOLE_SIZE);
        let device = hal(&self.device)?.raw_device().clone();
        let mut encoder = self.device.create_command_encoder(&Default::default());
        // SAFETY: nobody destroys what this gives. It is held while commands are recorded, so that a device that is lost
        // meanwhile does not destroy the buffer.
        let alive = unsafe { self.buffer.as_hal::<Vulkan>() }.ok_or(InteropError::Lost)?;
        // SAFETY: the encoder records nothing else, and is ended by wgpu.
        let recorded = unsafe {
            encoder.as_hal_mut::<Vulkan, _, _>(|encoder| {
                let commands = encoder?.raw_handle();
                // SAFETY: commands are being recorded, outside any render pass, and the buffer is alive.
                device.cmd_pipeline_barrier(
                    commands,
                    before,
                    after,
                    vk::DependencyFlags::empty(),
                    &[],
                    &[barrier],
                    &[],
                );
                Some(())
            })
        };
        drop(alive);
        recorded.ok_or(InteropError::Lost)?;
        // A lost device takes no submission; one that is running keeps its buffers until the queue is empty.
        self.last = Some(self.queue.submit([encoder.finish()]));
        Ok(())
    }

    /// Submits a copy to another buffer.
    pub fn copy_to(&self, bytes: Range<u64>, target: &wgpu::Buffer, offset: u64) {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let size = bytes.end.saturating_sub(bytes.start);
        encoder.copy_buffer_to_buffer(&self.buffer, bytes.start, target, offset, size);
        self.queue.submit([encoder.finish()]);
    }
}

#[cfg(test)]
mod tests {
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};

    use super::*;
    use crate::backend::cuda::emulator::skip;

    /// A Vulkan device, lavapipe's included, if there is any.
    fn device() -> Option<(wgpu::Device, wgpu::Queue)> {
        fn ready<F: Future>(future: F) -> F::Output {
            match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
                Poll::Ready(ready) => ready,
                Poll::Pending => panic!("native devices are ready at once"),
            }
        }
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        let instance = wgpu::Instance::new(descriptor);
        let adapter = ready(instance.request_adapter(&Default::default())).ok()?;
        ready(adapter.request_device(&Default::default())).ok()
    }

    #[test]
    fn a_buffer_is_handed_over_and_taken_back() {
        let Some((device, queue)) = device() else { return skip("there is no Vulkan") };
        match uuid(&device) {
            // Renderers on the processor share no memory: nobody can ask for that everywhere.
            Err(error @ InteropError::CannotShare(_)) => return println!("{error}"),
            found => assert_ne!(found, Ok([0; 16])),
        }
        let memory = SharedMemory::new(&device, 1000).expect("memory is there");
        assert!(memory.allocated() >= 1000);
        let [first, second] = [(); 2].map(|()| memory.descriptor().expect("memory can be exported"));
        let mut shared = memory.into_buffer(&device, &queue, 1000).expect("it is Vulkan's");
        drop(first);
        let target = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 1000,
            usage: wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        shared.acquire().expect("the device lives");
        for _ in 0..3 {
            shared.copy_to(0..1000, &target, 0);
            shared.release().expect("the device lives");
            shared.acquire().expect("the device lives");
        }
        // Whoever has a descriptor, or the buffer, keeps the memory.
        let buffer = shared.buffer().clone();
        drop(shared);
        drop(second);
        assert_eq!((buffer.size(), buffer.usage()), (1000, USAGES));
    }

    #[test]
    fn a_lost_device_hands_nothing_over() {
        let Some((device, queue)) = device() else { return skip("there is no Vulkan") };
        if uuid(&device).is_err() {
            return println!("nothing to share");
        }
        let memory = SharedMemory::new(&device, 64).expect("memory is there");
        let mut shared = memory.into_buffer(&device, &queue, 64).expect("it is Vulkan's");
        shared.acquire().expect("the device lives");
        device.destroy();
        let _ = device.poll(wgpu::PollType::wait_indefinitely());
        assert_eq!(shared.release(), Err(InteropError::Lost));
    }
}
