// What kernels.cu needs of CUDA, for a C++ compiler: a block's threads are fibers that run one at a time and change at
// barriers. A fiber that meets a barrier waits until all of its warp, or of its block, have come there.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#define __global__
#define __device__
#define __noinline__
#define __launch_bounds__(...)
// One block runs at a time. A section of its own, so that it can be filled with rubbish before each block.
#define __shared__ static EMULATOR_SHARED
#ifdef BURROW_SANITIZE
#define EMULATOR_SHARED
#else
#define EMULATOR_SHARED __attribute__((section("emulator_shared")))
#endif

struct uint2 {
    unsigned int x, y;
};
struct alignas(16) uint4 {
    unsigned int x, y, z, w;
};
struct alignas(8) ushort4 {
    unsigned short x, y, z, w;
};
struct uint3 {
    unsigned int x, y, z;
};

// Of the fiber that runs.
extern uint3 threadIdx, blockIdx;

namespace emulator {

// Waits for all of the warp; returns what each of its lanes brought.
const uint64_t* meet_warp(unsigned mask, uint64_t brought);
// Waits for all of the block; returns whether any of its threads brought something.
bool meet_block(bool brought);
// Gives up the launch.
[[noreturn]] void fail(const char* why);

template <typename T>
uint64_t to_word(T value) {
    static_assert(sizeof(T) <= 8);
    uint64_t word = 0;
    memcpy(&word, &value, sizeof(T));
    return word;
}

template <typename T>
T of_word(uint64_t word) {
    T value;
    memcpy(&value, &word, sizeof(T));
    return value;
}

}  // namespace emulator

inline void __syncthreads() { emulator::meet_block(false); }
inline int __syncthreads_or(int predicate) { return emulator::meet_block(predicate != 0); }
inline void __syncwarp(unsigned mask = 0xffffffff) { emulator::meet_warp(mask, 0); }

inline unsigned __ballot_sync(unsigned mask, int predicate) {
    const uint64_t* brought = emulator::meet_warp(mask, predicate != 0);
    unsigned word = 0;
    for (int lane = 0; lane < 32; lane++) word |= (unsigned)brought[lane] << lane;
    return word;
}
inline int __any_sync(unsigned mask, int predicate) { return __ballot_sync(mask, predicate) != 0; }
inline int __all_sync(unsigned mask, int predicate) { return __ballot_sync(mask, predicate) == 0xffffffff; }

template <typename T>
T __shfl_sync(unsigned mask, T value, int from) {
    return emulator::of_word<T>(emulator::meet_warp(mask, emulator::to_word(value))[from & 31]);
}
template <typename T>
T __shfl_xor_sync(unsigned mask, T value, unsigned by) {
    return __shfl_sync(mask, value, (int)((threadIdx.x & 31) ^ by));
}
template <typename T>
T __shfl_up_sync(unsigned mask, T value, unsigned by) {
    int from = (int)(threadIdx.x & 31) - (int)by;
    const uint64_t* brought = emulator::meet_warp(mask, emulator::to_word(value));
    return from < 0 ? value : emulator::of_word<T>(brought[from]);
}
template <typename T>
T __shfl_down_sync(unsigned mask, T value, unsigned by) {
    unsigned from = (threadIdx.x & 31) + by;
    const uint64_t* brought = emulator::meet_warp(mask, emulator::to_word(value));
    return from > 31 ? value : emulator::of_word<T>(brought[from]);
}

// Fibers change at barriers only, so nothing comes in between.
template <typename T>
T atomicAdd(T* at, T value) {
    T old = *at;
    *at = old + value;
    return old;
}
inline unsigned atomicAdd(unsigned* at, int value) { return atomicAdd(at, (unsigned)value); }
inline unsigned atomicOr(unsigned* at, unsigned value) {
    unsigned old = *at;
    *at = old | value;
    return old;
}

// Four of the eight bytes of `low` and `high`, named by four digits, the lowest first.
inline unsigned __byte_perm(unsigned low, unsigned high, unsigned digits) {
    uint64_t bytes = low | (uint64_t)high << 32;
    unsigned word = 0;
    for (int i = 0; i < 4; i++) word |= (unsigned)(bytes >> (digits >> i * 4 & 7) * 8 & 0xff) << i * 8;
    return word;
}
inline int __popc(unsigned value) { return __builtin_popcount(value); }
inline int __clz(int value) { return value == 0 ? 32 : __builtin_clz((unsigned)value); }
inline int __clzll(long long value) { return value == 0 ? 64 : __builtin_clzll((unsigned long long)value); }
inline int __ffs(int value) { return __builtin_ffs(value); }
inline int __ffsll(long long value) { return __builtin_ffsll(value); }
inline int __float_as_int(float value) { return emulator::of_word<int>(emulator::to_word(value)); }
inline int __double2loint(double value) { return (int)(uint32_t)emulator::to_word(value); }
// On the device it is up to two units of the last place off.
inline float __fdividef(float a, float b) { return a / b; }
