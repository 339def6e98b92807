/* What the C client gets of two raw streams and the finger; prints a line of JSON.
 *
 * Run by bench/websocket.py; the same as measure.ts of the TypeScript client.
 */
#define _DEFAULT_SOURCE
#include "frictus.h"

#define MOST 100000
#define KINDS 2

static const char *const NAMES[KINDS] = {"samples", "finger"};

/* Age of the newest sample or state of a message when it came, ms. */
static double age_ms(const frictus_event *event)
{
    double since = event->columns - 1.0;
    if (event->kind == FRICTUS_FINGER)
        since = (double)(frictus_finger_at(event, event->columns - 1).sample - event->first_sample);
    return (frictus_now_us() - (double)event->utc_ns / 1e3) / 1e3 -
           1e3 * since / event->sample_rate_hz;
}

static int ascending(const void *left, const void *right)
{
    double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

int main(void)
{
    static double ages[KINDS][MOST];
    unsigned long long came[KINDS] = {0}, lost[KINDS] = {0};
    size_t messages[KINDS] = {0};
    const char *port = getenv("FRICTUS_PORT"), *lasts = getenv("FRICTUS_SECONDS");
    double seconds, began_ms;
    clock_t began;
    frictus rig;
    frictus_event event;
    int kind, got;
    if (!port || !lasts)
        return 2;
    seconds = atof(lasts);
    if (frictus_open(&rig, "127.0.0.1", atoi(port), NULL) ||
        frictus_watch(&rig, "rig1", "\"force\",\"accel\"", 1, 1))
        goto failed;
    while (messages[0] == 0 || messages[1] == 0) { /* both have begun */
        if ((got = frictus_poll(&rig, 100, &event)) < 0)
            goto failed;
        if (got && event.kind != FRICTUS_TEXT)
            messages[event.kind == FRICTUS_FINGER] = 1;
    }
    messages[0] = messages[1] = 0;
    began = clock();
    began_ms = frictus_now_us() / 1e3;
    while (frictus_now_us() / 1e3 - began_ms < 1e3 * seconds) {
        if ((got = frictus_poll(&rig, 10, &event)) < 0)
            goto failed;
        if (!got || event.kind == FRICTUS_TEXT || event.columns == 0)
            continue;
        kind = event.kind == FRICTUS_FINGER;
        came[kind] += event.columns;
        lost[kind] += event.lost;
        if (messages[kind] < MOST)
            ages[kind][messages[kind]++] = age_ms(&event);
    }
    printf("{\"seconds\":%g,\"samples\":%llu,\"lostSamples\":%llu,\"states\":%llu,"
           "\"lostStates\":%llu,\"cpu_percent\":%.1f",
           seconds, came[0], lost[0], came[1], lost[1],
           100.0 * (double)(clock() - began) / CLOCKS_PER_SEC / seconds);
    for (kind = 0; kind < KINDS; kind++) {
        size_t last = messages[kind] - 1;
        qsort(ages[kind], messages[kind], sizeof(double), ascending);
        printf(",\"age_%s_ms\":[%.2f,%.2f,%.2f]", NAMES[kind], ages[kind][last / 2],
               ages[kind][(size_t)(0.99 * (double)last)], ages[kind][last]);
    }
    puts("}");
    frictus_close(&rig);
    return 0;
failed:
    fprintf(stderr, "%s\n", rig.error);
    frictus_close(&rig);
    return 1;
}
