/* What the test asks of the headers at their edges: numbers in the locale of the environment,
 * updates out of range, a service that falls silent. Usage: edges HOST PORT. */
#define _DEFAULT_SOURCE
#include "frictus.h"
#include <locale.h>

static void number(const char *text)
{
    char json[100];
    snprintf(json, sizeof json, "{\"before\":{\"n\":7},\"n\":%s,\"after\":1}", text);
    printf("number %s %.0f\n", text, 1e6 * frictus_number(json, "n", -1.0));
}

int main(int count, char **arguments)
{
    static const char *const texts[] = {"0",    "-0.25", "12.5e1", "25E-2", "1700000000000000", ".",
                                        "null", "-",     "1e",     "1x",    "\"1\"",            "1e999"};
    static const double wrong[][3] = {{2.0, 361.0, 0.0}, {0.0, 0.0, 0.0}, {1e9, 0.0, 0.0}};
    const double nan_ = nan(""), infinite = 1e308 * 10.0;
    float ridge[64] = {0};
    frictus rig;
    frictus_event event;
    size_t at;
    int got;
    if (count != 3 || !setlocale(LC_ALL, ""))
        return 2;
    printf("locale %.1f\n", 0.5);
    for (at = 0; at < sizeof texts / sizeof *texts; at++)
        number(texts[at]);
    if (frictus_open(&rig, arguments[1], atoi(arguments[2]), NULL))
        return 3;
    printf("peak %d %d\n", frictus_open_stream(&rig, "rig1", nan_),
           frictus_open_stream(&rig, "rig1", 11.0));
    if (frictus_open_stream(&rig, "rig1", 0.05))
        return 4;
    for (at = 0; at < 3; at++)
        printf("update %d %s\n",
               frictus_update(&rig, ridge, 64, wrong[at][0], 0, wrong[at][1], 200), rig.error);
    printf("update %d %s\n", frictus_update(&rig, ridge, 64, nan_, 1, 0.0, 200), rig.error);
    printf("update %d %s\n", frictus_update(&rig, ridge, 64, 2.0, 0, nan_, 200), rig.error);
    printf("update %d %s\n", frictus_update(&rig, ridge, 64, 2.0, 0, 0.0, 0), rig.error);
    ridge[63] = (float)infinite;
    printf("update %d %s\n", frictus_update(&rig, ridge, 64, 2.0, 0, 0.0, 200), rig.error);
    ridge[63] = (float)nan_;
    printf("update %d %s\n", frictus_update(&rig, ridge, 64, 2.0, 0, 0.0, 200), rig.error);
    ridge[63] = -0.06f;
    printf("update %d %s\n", frictus_update(&rig, ridge, 64, 2.0, 0, 0.0, 200), rig.error);
    ridge[63] = -0.05f;
    printf("good %d\n", frictus_update(&rig, ridge, 64, 2.0, 0, 0.0, 200));
    while ((got = frictus_poll(&rig, 1000, &event)) >= 0)
        ;
    printf("end %s\n", rig.error);
    frictus_close(&rig);
    return 0;
}
