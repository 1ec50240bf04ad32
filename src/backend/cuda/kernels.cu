// The CUDA kernels. Each runs one block of 128 threads per job:
//
//   scatter       copies uploaded data to its destinations
//   edit          applies edits to one brick           like edits/brick_editor.rs
//   stencil_edit  the same, including stencil edits    like edits/stencil_edit.rs
//   surface_*     distances of one brick's samples     like edits/surface_distance.rs
//                 to the surface, step by step
//   mesh          meshes the cells of one brick        like surface/block.rs
//   heights       computes heights from noise          like ground/noise_heights.rs; one block per 1024 columns
//
// All results are bit-identical to those of the CPU. Densities are integers. Floats and doubles go through the same
// exactly rounded operations in the same order, so the compiler must not fuse operations (--fmad=false) and must
// round divisions and square roots exactly.
//
// Blocks share only the counters from which each one reserves space for its output. The order of blocks in the
// output is therefore arbitrary, but the order within a block is fixed. Counters keep counting past the capacity of
// a list, which tells the host how much space is needed. They are 32 bits wide, which limits what one launch may
// request (see layout/).
//
// tools/emulator compiles the same sources as plain C++ for tests without a CUDA device.

#include "kernels/stencil_edit.cuh"
#include "kernels/heights.cuh"
#include "kernels/mesh.cuh"

extern "C" __global__ void __launch_bounds__(THREADS) scatter(ScatterParams params) {
    ScatterJob job = params.jobs[blockIdx.x];
    const uint4* from = (const uint4*)job.from;
    uint4* to = (uint4*)job.to;
    for (u32 i = threadIdx.x; i < job.bytes / 16; i += THREADS) to[i] = from[i];
}
