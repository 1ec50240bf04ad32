/* A driver library with three cards that compute nothing. Recorded events complete after 60 ms. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { CARDS = 3, FIRST_HANDLE = 70, INVALID_VALUE = 1, INVALID_DEVICE = 101, NOT_READY = 600 };

struct event { unsigned flags; double done; };

static _Thread_local void* current;

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec + time.tv_nsec * 1e-9;
}

int cuInit(unsigned flags) { (void)flags; return 0; }
int cuGetErrorName(int code, const char** name) { (void)code; *name = "CUDA_ERROR"; return 0; }
int cuDeviceGetCount(int* count) { *count = CARDS; return 0; }

int cuDeviceGet(int* device, int number) {
    if (number < 0 || number >= CARDS) return INVALID_DEVICE;
    *device = FIRST_HANDLE + number;
    return 0;
}

int cuDeviceGetUuid(unsigned char* uuid, int device) { memset(uuid, device, 16); return 0; }

int cuDeviceGetByPCIBusId(int* device, const char* id) {
    unsigned domain, bus, slot, function;
    if (sscanf(id, "%x:%x:%x.%x", &domain, &bus, &slot, &function) != 4) return INVALID_VALUE;
    if (domain || bus < 1 || bus > CARDS || slot || function) return INVALID_DEVICE;
    *device = FIRST_HANDLE + (int)bus - 1;
    return 0;
}

int cuDeviceGetName(char* name, int length, int device) {
    snprintf(name, length, "gpu %d", device - FIRST_HANDLE);
    return 0;
}

/* Compute capability 9.0. */
int cuDeviceGetAttribute(int* value, int attribute, int device) {
    (void)device;
    *value = attribute == 75 ? 9 : 0;
    return 0;
}

int cuDevicePrimaryCtxRetain(void** context, int device) { *context = (void*)(size_t)device; return 0; }
int cuDevicePrimaryCtxRelease_v2(int device) { (void)device; return 0; }
int cuCtxGetCurrent(void** context) { *context = current; return 0; }
int cuCtxSetCurrent(void* context) { current = context; return 0; }
int cuCtxSynchronize(void) { return 0; }
int cuModuleLoadData(void** module, const void* image) { (void)image; *module = &current; return 0; }
int cuModuleGetFunction(void** function, void* module, const char* name) {
    (void)module, (void)name;
    *function = &current;
    return 0;
}
int cuModuleUnload(void* module) { (void)module; return 0; }
int cuStreamCreate(void** stream, unsigned flags) { (void)flags; *stream = &current; return 0; }
int cuStreamDestroy_v2(void* stream) { (void)stream; return 0; }

int cuEventCreate(struct event** event, unsigned flags) {
    *event = malloc(sizeof **event);
    **event = (struct event){flags, 0};
    return 0;
}

int cuEventRecord(struct event* event, void* stream) {
    (void)stream;
    event->done = now() + 0.06;
    return 0;
}

int cuEventQuery(struct event* event) { return now() < event->done ? NOT_READY : 0; }

/* Sleeps if the event was created with the blocking flag, else spins, as drivers do. */
int cuEventSynchronize(struct event* event) {
    struct timespec nap = {0, 1000000};
    while (cuEventQuery(event))
        if (event->flags & 1) nanosleep(&nap, 0);
    return 0;
}

int cuEventDestroy_v2(struct event* event) { free(event); return 0; }
