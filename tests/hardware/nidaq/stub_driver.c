/* As much of NI's driver library as the backend calls, for the path that needs no server.
   One device, whose clock passes by reads alone; the output is fed back to the last input.
   The output holds its last value when its task stops or runs dry. */
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { QUEUE = 1 << 18, RAN_DRY = -200290, NOT_YET = -200284, NO_DEVICE = -200220,
       RESERVED = -50103, BEYOND_RANGE = -200561 };

typedef struct { int is_output, channels, running, error; double rate, limit; } Task;

static Task *inputs, *output;
static double queue[QUEUE], sensed[QUEUE], output_v;
static int64_t written, played, acquired, taken;
static int planned, due_sample;

double stub_output_v(void) { return output_v; }
void stub_fail(int code, int sample) { planned = code; due_sample = sample; }

static void pass(int64_t ticks) {
    for (; ticks > 0 && inputs && inputs->running; ticks--) {
        if (output && output->running && !output->error) {
            if (played < written) output_v = queue[played++ % QUEUE];
            else output->error = RAN_DRY;
        }
        sensed[acquired++ % QUEUE] = output_v;
    }
}

static int strike(void) {
    int code = planned;
    if (!code || acquired < due_sample) return 0;
    planned = 0;
    if (code == NOT_YET) return code;
    if (inputs) inputs->error = code;
    if (output) output->error = code;
    return code;
}

int DAQmxResetDevice(const char *device) {
    if (strcmp(device, "Dev1")) return NO_DEVICE;
    if (inputs) inputs->running = 0;
    if (output) output->running = 0;
    inputs = output = 0;
    output_v = 0.0;
    return 0;
}
int DAQmxCreateTask(const char *name, Task **task) {
    (void)name;
    *task = calloc(1, sizeof **task);
    return 0;
}
int DAQmxClearTask(Task *task) {
    if (inputs == task) inputs = 0;
    if (output == task) output = 0;
    free(task);
    return 0;
}
int DAQmxStopTask(Task *task) {
    int error = task->error;
    task->running = task->error = 0;
    return error;
}
int DAQmxStartTask(Task *task) {
    if (task->is_output) {
        if (output) return RESERVED;
        output = task;
        played = 0;
    } else {
        if (inputs) return RESERVED;
        inputs = task;
        acquired = taken = 0;
    }
    task->running = 1;
    return 0;
}
int DAQmxCreateAIVoltageChan(Task *task, const char *channels, const char *name, int terminals,
                             double low, double high, int units, const char *scale) {
    (void)name, (void)terminals, (void)low, (void)high, (void)units, (void)scale;
    if (strncmp(channels, "Dev1/", 5)) return NO_DEVICE;
    for (task->channels++; (channels = strchr(channels, ',')); channels++) task->channels++;
    return 0;
}
int DAQmxCreateAOVoltageChan(Task *task, const char *channel, const char *name, double low,
                             double high, int units, const char *scale) {
    (void)name, (void)low, (void)units, (void)scale;
    if (strncmp(channel, "Dev1/", 5)) return NO_DEVICE;
    task->is_output = 1;
    task->limit = high;
    written = 0;
    return 0;
}
int DAQmxCfgSampClkTiming(Task *task, const char *source, double rate, int edge, int mode,
                          uint64_t buffer) {
    (void)source, (void)edge, (void)mode, (void)buffer;
    task->rate = rate;
    return 0;
}
int DAQmxWriteAnalogF64(Task *task, int n, uint32_t start, double timeout, int layout,
                        const double *values, int *done, uint32_t *reserved) {
    int code = strike();
    (void)start, (void)timeout, (void)layout, (void)reserved;
    *done = 0;
    if (code || task->error) return code ? code : task->error;
    for (int i = 0; i < n; i++) {
        if (values[i] > task->limit || values[i] < -task->limit) return BEYOND_RANGE;
        queue[written++ % QUEUE] = values[i];
    }
    *done = n;
    return 0;
}
int DAQmxWriteAnalogScalarF64(Task *task, uint32_t start, double timeout, double value,
                              uint32_t *reserved) {
    (void)task, (void)start, (void)timeout, (void)reserved;
    if (output) return RESERVED;
    output_v = value;
    return 0;
}
int DAQmxReadAnalogF64(Task *task, int n, double timeout, int layout, double *values,
                       uint32_t size, int *done, uint32_t *reserved) {
    int code = strike();
    int64_t missing = taken + n - acquired, most = (int64_t)(timeout * task->rate);
    (void)layout, (void)reserved;
    *done = 0;
    if (code || task->error) return code ? code : task->error;
    pass(missing < most ? missing : most);
    memset(values, 0, size * sizeof *values);
    for (; *done < n && taken < acquired; (*done)++)
        values[(task->channels - 1) * n + *done] = sensed[taken++ % QUEUE];
    return *done < n ? NOT_YET : 0;
}
int DAQmxGetReadAttribute(Task *task, int attribute, uint64_t *value) {
    int code = strike();
    (void)attribute;
    *value = (uint64_t)acquired;
    return code ? code : task->error;
}
int DAQmxGetTimingAttribute(Task *task, int attribute, double *value) {
    (void)attribute;
    *value = task->rate * task->channels;
    return 0;
}
int DAQmxGetTaskAttribute(Task *task, int attribute, char *value, uint32_t size) {
    (void)task, (void)attribute;
    if (!size) return 5;
    strcpy(value, "task");
    return 0;
}
int DAQmxSetWriteAttribute(Task *task, int attribute, ...) {
    (void)task, (void)attribute;
    return 0;
}
int DAQmxSetBufferAttribute(Task *task, int attribute, ...) {
    (void)task, (void)attribute;
    return 0;
}
int DAQmxSetChanAttribute(Task *task, const char *channel, int attribute, ...) {
    (void)task, (void)channel, (void)attribute;
    return 0;
}
int DAQmxGetDeviceAttribute(const char *device, int attribute, int *value) {
    (void)attribute;
    *value = 13612; /* PCI Express */
    return strcmp(device, "Dev1") ? NO_DEVICE : 0;
}
int DAQmxGetSystemInfoAttribute(int attribute, uint32_t *value) {
    (void)attribute;
    *value = 25;
    return 0;
}
static int describe(char *text, uint32_t size) {
    return size ? snprintf(text, size, "a fault of the stub") * 0 : 20;
}
int DAQmxGetExtendedErrorInfo(char *text, uint32_t size) { return describe(text, size); }
int DAQmxGetErrorString(int code, char *text, uint32_t size) {
    (void)code;
    return describe(text, size);
}
int DAQmxInternalGetLastCreatedChan(char *name, uint32_t size) {
    if (!size) return 5;
    strcpy(name, "chan");
    return 0;
}
