// The work of a transaction on the device: bricks are brought there, edited, and meshed.
//
// Five kernels, a block of 128 threads for each job:
//
//   scatter       copies what the host sent to where it belongs
//   edit          applies edits to one brick            as edits/brick_editor.rs does
//   stencil_edit  the same, with edits that sculpt      as edits/stencil_edit.rs does
//   mesh          meshes the cells of one brick         as surface/block.rs does
//   heights       computes heights of noise             as ground/noise_heights.rs does, a block for 1024 columns
//
// All give the very bits of the CPU. Densities are integers; floats and doubles are used in the same order of exactly rounded
// operations, which takes a compiler that fuses none of them (--fmad=false) and rounds divisions and roots exactly.
//
// Blocks share nothing but counters from which each reserves room for its output, so blocks come out in any order, while
// the order inside a block is fixed. Counters go on past the end of the room: the host then knows how much is needed.
// They are 32 bits wide; what one launch may ask for must fit (see layout/).
//
// The same sources are compiled for the CPU by tools/emulator, as plain C++, to be tested where there is no device.

#include "kernels/stencil_edit.cuh"
#include "kernels/heights.cuh"
#include "kernels/mesh.cuh"

extern "C" __global__ void __launch_bounds__(THREADS) scatter(ScatterParams params) {
    ScatterJob job = params.jobs[blockIdx.x];
    const uint4* from = (const uint4*)job.from;
    uint4* to = (uint4*)job.to;
    for (u32 i = threadIdx.x; i < job.bytes / 16; i += THREADS) to[i] = from[i];
}
