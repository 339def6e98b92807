/* Plays ridges on a rig for some seconds, and tells where the finger is and what was lost.
 *
 *     cc -std=c99 -O2 example.c -lm -o example && ./example 127.0.0.1 8420 rig1 5
 *
 * A token is taken from the environment, FRICTUS_TOKEN.
 */
#define _DEFAULT_SOURCE
#include "frictus.h"

#define SAMPLES 64
#define PEAK_N 0.05
#define UPDATE_MS 20.0

static int fail(frictus *rig)
{
    fprintf(stderr, "%s\n", rig->error);
    frictus_close(rig);
    return 1;
}

int main(int count, char **arguments)
{
    frictus rig;
    frictus_event event;
    frictus_finger finger;
    float ridge[SAMPLES];
    double began_ms, due_ms, now_ms;
    unsigned long long samples = 0, lost = 0, states = 0;
    int index, got;
    if (count != 5) {
        fprintf(stderr, "usage: %s HOST PORT RIG SECONDS\n", arguments[0]);
        return 2;
    }
    memset(&finger, 0, sizeof finger);
    for (index = 0; index < SAMPLES; index++)
        ridge[index] = (float)(0.8 * PEAK_N * cos(2.0 * 3.14159265358979 * index / SAMPLES));
    if (frictus_open(&rig, arguments[1], atoi(arguments[2]), getenv("FRICTUS_TOKEN")) ||
        frictus_arm(&rig, arguments[3], 3000) ||
        frictus_open_stream(&rig, arguments[3], PEAK_N) ||
        frictus_watch(&rig, arguments[3], "\"force\",\"accel\"", 1, 1))
        return fail(&rig);
    due_ms = began_ms = frictus_now_us() / 1e3;
    while ((now_ms = frictus_now_us() / 1e3) - began_ms < 1e3 * atof(arguments[4])) {
        if (now_ms >= due_ms) {
            if (frictus_update(&rig, ridge, SAMPLES, 2.0, 0, 0.0, 1000))
                return fail(&rig);
            due_ms += UPDATE_MS;
        }
        if ((got = frictus_poll(&rig, 5, &event)) < 0)
            return fail(&rig);
        if (got && event.kind == FRICTUS_SAMPLES) {
            samples += event.columns;
            lost += event.lost;
        } else if (got && event.kind == FRICTUS_FINGER && event.columns > 0) {
            states += event.columns;
            finger = frictus_finger_at(&event, event.columns - 1);
        }
    }
    printf("samples %llu lost %llu states %llu finger %.2f %.2f mm\n", samples, lost, states,
           finger.x_mm, finger.y_mm);
    if (frictus_close_stream(&rig, &event))
        return fail(&rig);
    printf("updates %llu passed on %.0f\n", (unsigned long long)rig.updates,
           frictus_number(event.text, "sent", -1.0));
    if (frictus_disarm(&rig, arguments[3]))
        return fail(&rig);
    frictus_close(&rig);
    return 0;
}
