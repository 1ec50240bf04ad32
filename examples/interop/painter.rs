//! Draws surfaces out of one buffer to a texture, with plain wgpu.

use std::pin::pin;
use std::task::{Context, Poll, Waker};

use bevy_burrow::backend::interop::{BlockRange, SurfaceLayout};
use bevy_burrow::surface::block::Block;
use glam::{Mat4, Vec3};
use wgpu::util::DrawIndexedIndirectArgs;

/// The picture's sides; rows of so many pixels need no padding on read-back.
pub const SIDES: [u32; 2] = [1280, 800];

const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

type Failed = Box<dyn std::error::Error>;

/// A device with a pipeline, and what a picture takes.
pub struct Painter {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub name: String,
    pipeline: wgpu::RenderPipeline,
    camera: wgpu::BindGroup,
    color: wgpu::Texture,
    depth: wgpu::Texture,
    back: wgpu::Buffer,
    /// For each block that draws something: its arguments, its brick's lowest sample.
    draws: wgpu::Buffer,
    origins: wgpu::Buffer,
    count: u32,
}

/// Waits for something that wgpu's native devices have ready at once.
fn wait<F: Future>(future: F) -> F::Output {
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(ready) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return ready;
        }
        std::thread::yield_now();
    }
}

fn buffer(device: &wgpu::Device, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
    device.create_buffer(&descriptor)
}

impl Painter {
    /// Room for so many blocks.
    pub fn new(blocks: usize) -> Result<Self, Failed> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        // Nobody else writes the arguments of draws.
        descriptor.flags = wgpu::InstanceFlags::empty();
        let instance = wgpu::Instance::new(descriptor);
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = wait(instance.request_adapter(&options))?;
        let limits = adapter.limits();
        let (device, queue) = wait(adapter.request_device(&wgpu::DeviceDescriptor {
            required_features: wgpu::Features::INDIRECT_FIRST_INSTANCE,
            required_limits: limits,
            ..Default::default()
        }))?;
        let (pipeline, camera) = pipeline(&device, &queue);
        let size = wgpu::Extent3d { width: SIDES[0], height: SIDES[1], depth_or_array_layers: 1 };
        let texture = |format, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let usage = wgpu::BufferUsages::COPY_DST;
        let (blocks, pixels) = (blocks.max(1) as u64, u64::from(SIDES[0] * SIDES[1]));
        Ok(Self {
            name: adapter.get_info().name,
            color: texture(COLOR, wgpu::TextureUsages::COPY_SRC),
            depth: texture(DEPTH, wgpu::TextureUsages::empty()),
            back: buffer(&device, "read back", pixels * 4, usage | wgpu::BufferUsages::MAP_READ),
            draws: buffer(
                &device,
                "draws",
                blocks * size_of::<DrawIndexedIndirectArgs>() as u64,
                usage | wgpu::BufferUsages::INDIRECT,
            ),
            origins: buffer(&device, "origins", blocks * 12, usage | wgpu::BufferUsages::VERTEX),
            count: 0,
            pipeline,
            camera,
            device,
            queue,
        })
    }

    /// A buffer that surfaces can be uploaded or copied to, and drawn from.
    pub fn surface_buffer(&self, bytes: u64) -> wgpu::Buffer {
        let usage = wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::INDEX | wgpu::BufferUsages::COPY_DST;
        buffer(&self.device, "surfaces", bytes, usage)
    }

    /// Writes lists to a buffer.
    pub fn upload(
        &self,
        target: &wgpu::Buffer,
        layout: &SurfaceLayout,
        positions: &[[u16; 4]],
        normals: &[[f32; 3]],
        indices: &[u16],
    ) {
        self.queue.write_buffer(target, layout.positions.start, bytemuck::cast_slice(positions));
        self.queue.write_buffer(target, layout.normals.start, bytemuck::cast_slice(normals));
        // Copies are multiples of 4 bytes.
        let (pairs, rest) = indices.as_chunks::<2>();
        self.queue.write_buffer(target, layout.indices.start, bytemuck::cast_slice(pairs));
        if let [last] = rest {
            let start = layout.indices.start + size_of_val(pairs) as u64;
            self.queue.write_buffer(target, start, bytemuck::bytes_of(&[*last, 0]));
        }
    }

    /// Says which blocks are drawn, and where their surfaces are in the lists. Indices are counted from the buffer's start:
    /// lavapipe's indirect draws know nothing of an index buffer that begins elsewhere.
    pub fn list(
        &mut self,
        blocks: &[Block],
        ranges: impl Iterator<Item = BlockRange>,
        layout: &SurfaceLayout,
    ) {
        let (mut draws, mut origins) = (Vec::new(), Vec::new());
        let first = (layout.indices.start / size_of::<u16>() as u64) as u32;
        for (block, range) in blocks.iter().zip(ranges).filter(|(_, range)| range.indices > 0) {
            draws.push(DrawIndexedIndirectArgs {
                index_count: range.indices,
                instance_count: 1,
                first_index: first + range.index,
                base_vertex: range.vertex as i32,
                first_instance: draws.len() as u32,
            });
            origins.push(block.brick.origin().to_array());
        }
        self.count = draws.len() as u32;
        self.queue.write_buffer(&self.draws, 0, bytemuck::cast_slice(&draws));
        self.queue.write_buffer(&self.origins, 0, bytemuck::cast_slice(&origins));
    }

    /// Waits until everything that was written and submitted is done.
    pub fn settle(&self) -> Result<(), Failed> {
        self.queue.submit([]);
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        Ok(())
    }

    /// Draws what is listed out of a buffer, and waits for it.
    pub fn draw(&self, surfaces: &wgpu::Buffer, layout: &SurfaceLayout) -> Result<(), Failed> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let [color, depth] =
            [&self.color, &self.depth].map(|texture| texture.create_view(&Default::default()));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &color,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r: 0.42, g: 0.56, b: 0.7, a: 1.0 }),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.camera, &[]);
        pass.set_vertex_buffer(0, surfaces.slice(layout.positions.clone()));
        pass.set_vertex_buffer(1, surfaces.slice(layout.normals.clone()));
        pass.set_vertex_buffer(2, self.origins.slice(..));
        pass.set_index_buffer(surfaces.slice(..), wgpu::IndexFormat::Uint16);
        pass.multi_draw_indexed_indirect(&self.draws, 0, self.count);
        drop(pass);
        self.queue.submit([encoder.finish()]);
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        Ok(())
    }

    /// The picture that was drawn last, four bytes a pixel.
    pub fn pixels(&self) -> Result<Vec<u8>, Failed> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            self.color.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.back,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(SIDES[0] * 4),
                    rows_per_image: None,
                },
            },
            self.color.size(),
        );
        self.queue.submit([encoder.finish()]);
        let (send, receive) = std::sync::mpsc::channel();
        self.back.map_async(wgpu::MapMode::Read, .., move |mapped| drop(send.send(mapped)));
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        receive.recv()??;
        let pixels = self.back.get_mapped_range(..).to_vec();
        self.back.unmap();
        Ok(pixels)
    }
}

/// The pipeline and the camera, which looks over the whole level.
fn pipeline(device: &wgpu::Device, queue: &wgpu::Queue) -> (wgpu::RenderPipeline, wgpu::BindGroup) {
    let shader = device.create_shader_module(wgpu::include_wgsl!("shader.wgsl"));
    let attribute = |format, shader_location| [wgpu::VertexAttribute { format, offset: 0, shader_location }];
    let positions = attribute(wgpu::VertexFormat::Uint16x4, 0);
    let normals = attribute(wgpu::VertexFormat::Float32x3, 1);
    let origins = attribute(wgpu::VertexFormat::Sint32x3, 2);
    let list = |array_stride, step_mode, attributes| wgpu::VertexBufferLayout {
        array_stride,
        step_mode,
        attributes,
    };
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("blocks"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &shader,
            entry_point: None,
            compilation_options: Default::default(),
            buffers: &[
                list(8, wgpu::VertexStepMode::Vertex, &positions),
                list(12, wgpu::VertexStepMode::Vertex, &normals),
                list(12, wgpu::VertexStepMode::Instance, &origins),
            ],
        },
        primitive: wgpu::PrimitiveState { cull_mode: Some(wgpu::Face::Back), ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &shader,
            entry_point: None,
            compilation_options: Default::default(),
            targets: &[Some(COLOR.into())],
        }),
        multiview_mask: None,
        cache: None,
    });
    let eye = Vec3::new(256.0, 230.0, -120.0);
    let view = Mat4::look_at_rh(eye, Vec3::new(256.0, 0.0, 230.0), Vec3::Y);
    let aspect = SIDES[0] as f32 / SIDES[1] as f32;
    let clip = Mat4::perspective_infinite_reverse_rh(0.9, aspect, 1.0) * view;
    let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
    let uniform = buffer(device, "camera", 64, usage);
    queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&clip.to_cols_array()));
    let camera = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }],
    });
    (pipeline, camera)
}
