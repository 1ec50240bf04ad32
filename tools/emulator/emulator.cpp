// Runs the kernels of kernels.cu on the CPU, as a child process with memory of its own: it reads requests from its
// standard input and answers on its standard output. All numbers are 64-bit words, little-endian.
//
//   1 allocate  bytes                            -> address, 0 where there is no memory
//   2 free      address
//   3 write     address, length, bytes
//   4 read      address, length                  -> bytes
//   5 launch    kernel, blocks, length, params   -> 0, or 1 where it failed
//   6 fill      address, length, byte
//
// Kernels: 0 scatter, 1 edit, 2 mesh, 3 heights, 4 stencil_edit, 5 surface_start, 6 surface_spread. At the end of the
// input it ends. Past each allocation lies protected memory. With BURROW_EMULATOR_SHUFFLE set to a number, the threads of a block run in another order
// after each barrier, and some warps wait while others run on, which shows where a barrier is missing.

#include "emulator.h"

#include "../../src/backend/cuda/kernels.cu"

#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <sys/mman.h>
#include <ucontext.h>
#include <unistd.h>
#include <unordered_map>
#include <vector>

#ifdef BURROW_SANITIZE
#include <sanitizer/common_interface_defs.h>
#endif

uint3 threadIdx, blockIdx;

// Where __shared__ variables are, unless they are left to the sanitizer.
#ifndef BURROW_SANITIZE
extern char __start_emulator_shared[], __stop_emulator_shared[];
#endif

namespace emulator {

const int LANES = 32, WARPS = THREADS / LANES;
const size_t STACK = 256 * 1024;

enum class State { READY, AT_WARP, AT_BLOCK, DONE };

struct Fiber {
    ucontext_t context;
    jmp_buf jump;
    bool has_begun;
    State state;
    char* stack;
#ifdef BURROW_SANITIZE
    void* fake_stack;
#endif
};

static Fiber fibers[THREADS];
static int running;
// What fibers bring to a barrier, and what was brought to the last one.
static uint64_t bringing[THREADS], brought[THREADS];
static bool block_bringing, block_brought;

#ifdef BURROW_SANITIZE
static ucontext_t scheduler;
static void* scheduler_fake_stack;
static const void* scheduler_bottom;
static size_t scheduler_size;
#else
static jmp_buf scheduler_jump;
#endif

// The launch: a call of the kernel with its parameters.
static void (*kernel)(const void*);
static const void* kernel_params;

void fail(const char* why) {
    fprintf(stderr, "emulator: block %u, thread %u: %s\n", blockIdx.x, threadIdx.x, why);
    exit(3);
}

// ---- Changing from one fiber to another. Jumps are many times faster than swapcontext, which calls the kernel; the
// sanitizer has to be notified, and allows no jumps between stacks. ----

__attribute__((noinline)) static void leave(State state) {
    Fiber& fiber = fibers[running];
    fiber.state = state;
#ifdef BURROW_SANITIZE
    __sanitizer_start_switch_fiber(state == State::DONE ? nullptr : &fiber.fake_stack, scheduler_bottom, scheduler_size);
    swapcontext(&fiber.context, &scheduler);
    __sanitizer_finish_switch_fiber(fiber.fake_stack, &scheduler_bottom, &scheduler_size);
#else
    if (!_setjmp(fiber.jump)) _longjmp(scheduler_jump, 1);
#endif
}

static void begin() {
#ifdef BURROW_SANITIZE
    __sanitizer_finish_switch_fiber(nullptr, &scheduler_bottom, &scheduler_size);
#endif
    kernel(kernel_params);
    leave(State::DONE);
}

__attribute__((noinline)) static void resume(int number) {
    Fiber& fiber = fibers[number];
    running = number;
    threadIdx = {(unsigned)number, 0, 0};
#ifdef BURROW_SANITIZE
    __sanitizer_start_switch_fiber(&scheduler_fake_stack, fiber.stack, STACK);
    swapcontext(&scheduler, &fiber.context);
    __sanitizer_finish_switch_fiber(scheduler_fake_stack, nullptr, nullptr);
#else
    if (_setjmp(scheduler_jump)) return;
    if (fiber.has_begun) _longjmp(fiber.jump, 1);
    fiber.has_begun = true;
    setcontext(&fiber.context);
#endif
}

const uint64_t* meet_warp(unsigned mask, uint64_t word) {
    if (mask != 0xffffffff) fail("the emulator knows whole warps only");
    bringing[running] = word;
    leave(State::AT_WARP);
    return brought + running / LANES * LANES;
}

bool meet_block(bool word) {
    block_bringing |= word;
    leave(State::AT_BLOCK);
    return block_brought;
}

// ---- Blocks ----

static uint64_t shuffle_state = 0;

// A number below another one.
static int any(int below) {
    shuffle_state = shuffle_state * 6364136223846793005ull + 1442695040888963407ull;
    return (int)((shuffle_state >> 33) % (unsigned)below);
}

// The order in which fibers take turns, and which warps do.
static void reorder(int* order, bool* is_held) {
    if (shuffle_state == 0) return;
    for (int i = THREADS - 1; i > 0; i--) {
        int other = any(i + 1), kept = order[i];
        order[i] = order[other];
        order[other] = kept;
    }
    for (int warp = 0; warp < WARPS; warp++) is_held[warp] = any(4) != 0;
}

static bool all_are(int first, int count, State state) {
    for (int i = 0; i < count; i++) {
        if (fibers[first + i].state != state) return false;
    }
    return true;
}

static void release(int first, int count) {
    for (int i = first; i < first + count; i++) {
        brought[i] = bringing[i];
        fibers[i].state = State::READY;
    }
}

static void run_block(unsigned block) {
    blockIdx = {block, 0, 0};
#ifndef BURROW_SANITIZE
    memset(__start_emulator_shared, 0xa5, (size_t)(__stop_emulator_shared - __start_emulator_shared));
#endif
    int order[THREADS];
    bool is_held[WARPS] = {};
    for (int i = 0; i < THREADS; i++) {
        Fiber& fiber = fibers[i];
        order[i] = i;
        fiber.has_begun = false;
        fiber.state = State::READY;
        getcontext(&fiber.context);
        fiber.context.uc_stack.ss_sp = fiber.stack;
        fiber.context.uc_stack.ss_size = STACK;
        fiber.context.uc_link = nullptr;
        makecontext(&fiber.context, begin, 0);
    }
    block_bringing = false;
    while (!all_are(0, THREADS, State::DONE)) {
        bool has_moved = false;
        reorder(order, is_held);
        for (int number : order) {
            if (fibers[number].state != State::READY) continue;
            if (!is_held[number / LANES]) resume(number);
            has_moved = true;
        }
        for (int warp = 0; warp < WARPS; warp++) {
            if (!all_are(warp * LANES, LANES, State::AT_WARP)) continue;
            release(warp * LANES, LANES);
            has_moved = true;
        }
        if (all_are(0, THREADS, State::AT_BLOCK)) {
            block_brought = block_bringing;
            block_bringing = false;
            release(0, THREADS);
            has_moved = true;
        }
        if (!has_moved) fail("threads wait for others that do not come");
    }
}

// ---- Memory ----

struct Allocation {
    char* mapped;
    size_t length;
};

static std::unordered_map<uint64_t, Allocation> allocations;

// Memory with random content that ends where a protected page begins.
static uint64_t allocate(uint64_t bytes) {
    const uint64_t PAGE = (uint64_t)sysconf(_SC_PAGESIZE), MOST = 1ull << 40;
    if (bytes > MOST) return 0;
    uint64_t used = (bytes + 15) / 16 * 16, pages = (used + PAGE - 1) / PAGE * PAGE;
    void* mapped = mmap(nullptr, pages + PAGE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (mapped == MAP_FAILED) return 0;
    if (pages > 0 && mprotect(mapped, pages, PROT_READ | PROT_WRITE) != 0) {
        munmap(mapped, pages + PAGE);
        return 0;
    }
    char* start = (char*)mapped + pages - used;
    memset(start, 0xa5, used);
    allocations[(uint64_t)start] = {(char*)mapped, pages + PAGE};
    return (uint64_t)start;
}

static void release_memory(uint64_t address) {
    auto found = allocations.find(address);
    if (found == allocations.end()) return;
    munmap(found->second.mapped, found->second.length);
    allocations.erase(found);
}

// ---- Requests ----

template <typename Params, void (*KERNEL)(Params)>
static bool launch(const std::vector<char>& params, uint64_t blocks) {
    if (params.size() != sizeof(Params) || blocks > 0x7fffffff) return false;
    static Params copy;
    memcpy(&copy, params.data(), sizeof(Params));
    kernel = [](const void* params) { KERNEL(*(const Params*)params); };
    kernel_params = &copy;
    for (uint64_t block = 0; block < blocks; block++) run_block((unsigned)block);
    return true;
}

static bool launch(uint64_t number, uint64_t blocks, const std::vector<char>& params) {
    switch (number) {
        case 0: return launch<ScatterParams, scatter>(params, blocks);
        case 1: return launch<EditParams, edit>(params, blocks);
        case 2: return launch<MeshParams, mesh>(params, blocks);
        case 3: return launch<HeightsParams, heights>(params, blocks);
        case 4: return launch<StencilEditParams, stencil_edit>(params, blocks);
        case 5: return launch<SurfaceStartParams, surface_start>(params, blocks);
        case 6: return launch<SurfaceSpreadParams, surface_spread>(params, blocks);
        default: return false;
    }
}

static void read_bytes(void* to, size_t length) {
    if (length > 0 && fread(to, 1, length, stdin) != length) exit(feof(stdin) ? 0 : 1);
}

static uint64_t read_word() {
    uint64_t word;
    read_bytes(&word, sizeof word);
    return word;
}

static void answer(const void* bytes, size_t length) {
    if (length > 0 && fwrite(bytes, 1, length, stdout) != length) exit(1);
    if (fflush(stdout) != 0) exit(1);
}

static void answer_word(uint64_t word) { answer(&word, sizeof word); }

static void serve() {
    uint64_t request = read_word();
    if (request == 1) {
        answer_word(allocate(read_word()));
    } else if (request == 2) {
        release_memory(read_word());
    } else if (request == 3) {
        char* to = (char*)read_word();
        uint64_t length = read_word();
        read_bytes(to, length);
    } else if (request == 4) {
        const char* from = (const char*)read_word();
        uint64_t length = read_word();
        answer(from, length);
    } else if (request == 5) {
        uint64_t number = read_word(), blocks = read_word();
        std::vector<char> params(read_word());
        read_bytes(params.data(), params.size());
        answer_word(launch(number, blocks, params) ? 0 : 1);
    } else if (request == 6) {
        char* to = (char*)read_word();
        uint64_t length = read_word(), byte = read_word();
        memset(to, (int)byte, length);
    } else {
        fprintf(stderr, "emulator: no such request: %llu\n", (unsigned long long)request);
        exit(2);
    }
}

}  // namespace emulator

int main() {
    if (const char* shuffle = getenv("BURROW_EMULATOR_SHUFFLE")) {
        emulator::shuffle_state = strtoull(shuffle, nullptr, 10);
    }
    for (auto& fiber : emulator::fibers) {
        fiber.stack = (char*)malloc(emulator::STACK);
        if (!fiber.stack) return 1;
    }
    for (;;) emulator::serve();
}
