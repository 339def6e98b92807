/* The algorithm of frictus_service/synthesis/kernel.py in C, line by line, for comparison.
 *
 * The benchmark compiles it with -O3, checks that it renders the same numbers, and times it.
 * It reads the very arrays of a compiled scene; see SceneArrays for their shapes.
 */

#include <math.h>
#include <stdint.h>

#define TWO_PI 6.283185307179586

enum { SPATIAL, TEMPORAL, MAP };
enum { X0, X1, Y0, Y1, PER_FADE, GAIN, COS, SIN, ORIGIN, PER_STEP, LEVEL_OFFSET, REALS };
enum { KIND, FIRST, POINTS, ROWS, HALVINGS, WHOLES };

typedef struct {
    const double *real;
    const int64_t *whole;
    const double *points;
    const int64_t *levels;
    const float *pixels;
    int64_t layers;
    double bias_n;
} Scene;

typedef struct {
    double x_mm, y_mm, vx_0, vy_0, vx_1, vy_1, speed_0, speed_1;
} Motion;

typedef struct {
    double gain_n, cutoff_0, slope, slowest, fastest;
} Law;

static inline double least(double a, double b) { return b < a ? b : a; }
static inline double greatest(double a, double b) { return b > a ? b : a; }

static inline double smooth(double distance)
{
    double d = least(greatest(distance, 0.0), 1.0);
    return d * d * (3.0 - 2.0 * d);
}

static inline double weight_at(const double *real, double x, double y)
{
    if (!(real[X0] < x && x < real[X1] && real[Y0] < y && y < real[Y1]))
        return 0.0;
    double nearest = least(least(x - real[X0], real[X1] - x), least(y - real[Y0], real[Y1] - y));
    double edge = nearest * real[PER_FADE];
    return edge >= 1.0 ? real[GAIN] : real[GAIN] * smooth(edge);
}

static inline int64_t level_of(double rate, double offset, int64_t rows, double *share)
{
    *share = 0.0;
    if (rate < 1e-3)
        return 0;
    double level = 12.0 * log2(rate) + offset;
    if (level <= 0.0)
        return 0;
    if (level >= (double)(rows - 1))
        return rows - 1;
    int64_t row = (int64_t)level;
    *share = level - (double)row;
    return row;
}

static inline void cubic(double f, double w[4])
{
    w[0] = f * (-0.5 + f * (1.0 - 0.5 * f));
    w[1] = 1.0 + f * f * (-2.5 + 1.5 * f);
    w[2] = f * (0.5 + f * (2.0 - 1.5 * f));
    w[3] = f * f * (-0.5 + 0.5 * f);
}

static inline double around(const double *p, const double w[4])
{
    return w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3];
}

static inline double between_rows(const double *points, const int64_t *whole, double u,
                                  double rate, double offset)
{
    double w[4], share;
    int64_t row = level_of(rate, offset, whole[ROWS], &share);
    int64_t octave = row / 12 < whole[HALVINGS] ? row / 12 : whole[HALVINGS];
    int64_t n = whole[POINTS] >> octave;
    int64_t before = 13 * (2 * (whole[POINTS] - n) + 3 * octave);
    u /= (double)((int64_t)1 << octave);
    u -= (double)n * floor(u / (double)n);
    int64_t at = (int64_t)u < n - 1 ? (int64_t)u : n - 1;
    cubic(u - (double)at, w);
    const double *p = points + whole[FIRST] + before + (row - 12 * octave) * (n + 3) + at;
    double value = around(p, w);
    if (share > 0.0)
        value += share * (around(p + n + 3, w) - value);
    return value;
}

static inline double row_at(const double *points, const int64_t *whole, double cycles)
{
    int64_t n = whole[POINTS];
    double w[4];
    double u = (cycles - floor(cycles)) * (double)n;
    int64_t at = (int64_t)u < n - 1 ? (int64_t)u : n - 1;
    cubic(u - (double)at, w);
    return around(points + whole[FIRST] + at, w);
}

static inline int64_t within(int64_t value, int64_t size)
{
    value = value > 0 ? value : 0;
    return value < size - 1 ? value : size - 1;
}

static double bicubic(const float *pixels, const int64_t *level, double across, double along)
{
    int64_t width = level[1], height = level[2];
    double u = across * (double)width, v = along * (double)height;
    int64_t i = within((int64_t)u, width), j = within((int64_t)v, height);
    double a[4], b[4], value = 0.0;
    cubic(u - (double)i, a);
    cubic(v - (double)j, b);
    for (int r = 0; r < 4; r++) {
        const float *p = pixels + level[0] + (j + r) * (width + 3) + i;
        value += b[r] * (a[0] * p[0] + a[1] * p[1] + a[2] * p[2] + a[3] * p[3]);
    }
    return value;
}

static double map_at(const Scene *scene, const double *real, const int64_t *whole, double x,
                     double y, double speed)
{
    double share;
    int64_t row = level_of(speed, real[LEVEL_OFFSET], whole[ROWS], &share);
    double across = (x - real[X0]) / (real[X1] - real[X0]);
    double along = (y - real[Y0]) / (real[Y1] - real[Y0]);
    const int64_t *level = scene->levels + 3 * (whole[FIRST] + row);
    double value = bicubic(scene->pixels, level, across, along);
    if (share > 0.0)
        value += share * (bicubic(scene->pixels, level + 3, across, along) - value);
    return value;
}

void target_friction(const Scene *scene, const Motion *motion, int64_t first_sample,
                     double sample_rate_hz, int64_t samples, double *out)
{
    double step = 1.0 / sample_rate_hz;
    double ax = (motion->vx_1 - motion->vx_0) / ((double)samples * step);
    double ay = (motion->vy_1 - motion->vy_0) / ((double)samples * step);
    for (int64_t n = 0; n < samples; n++)
        out[n] = scene->bias_n;
    for (int64_t layer = 0; layer < scene->layers; layer++) {
        const double *real = scene->real + REALS * layer;
        const int64_t *whole = scene->whole + WHOLES * layer;
        int64_t kind = whole[KIND];
        for (int64_t n = 0; n < samples; n++) {
            double t = (double)n * step;
            double x = motion->x_mm + (motion->vx_0 + 0.5 * ax * t) * t;
            double y = motion->y_mm + (motion->vy_0 + 0.5 * ay * t) * t;
            double weight = weight_at(real, x, y);
            if (weight == 0.0)
                continue;
            double vx = motion->vx_0 + ax * t, vy = motion->vy_0 + ay * t, value;
            if (kind == SPATIAL) {
                double u = (x * real[COS] + y * real[SIN] - real[ORIGIN]) * real[PER_STEP];
                double rate = fabs(vx * real[COS] + vy * real[SIN]);
                value = between_rows(scene->points, whole, u, rate, real[LEVEL_OFFSET]);
            } else if (kind == TEMPORAL) {
                double u = (double)(first_sample + n) * step * real[PER_STEP];
                value = row_at(scene->points, whole, u);
            } else {
                value = map_at(scene, real, whole, x, y, hypot(vx, vy));
            }
            out[n] += weight * value;
        }
    }
}

void invert(const Law *law, const Motion *motion, double sample_rate_hz,
            const double *friction_n, double next_n, int64_t samples, double *out,
            int64_t counts[2])
{
    int64_t clipped = 0, extrapolated = 0;
    for (int64_t n = 0; n < samples; n++) {
        double speed = motion->speed_0
                       + (double)n / (double)samples * (motion->speed_1 - motion->speed_0);
        if (!(law->slowest <= speed && speed <= law->fastest)) {
            extrapolated++;
            speed = least(greatest(speed, law->slowest), law->fastest);
        }
        double decay = exp(-TWO_PI * (law->cutoff_0 + law->slope * speed) / sample_rate_hz);
        double following = n + 1 < samples ? friction_n[n + 1] : next_n;
        double drive = (following - decay * friction_n[n]) / ((1.0 - decay) * law->gain_n);
        if (!(0.0 <= drive && drive <= 1.0)) {
            clipped++;
            drive = drive > 1.0 ? 1.0 : 0.0;
        }
        out[n] = drive;
    }
    counts[0] = clipped;
    counts[1] = extrapolated;
}

double envelope(double level, double goal, double step, int64_t samples, double *drive)
{
    for (int64_t n = 0; n < samples; n++) {
        if (level < goal)
            level = least(level + step, goal);
        else if (level > goal)
            level = greatest(level - step, goal);
        drive[n] *= smooth(level);
    }
    return level;
}

void modulate(const double *drive, int64_t first, double peak_v, double carrier_hz,
              double sample_rate_hz, int64_t samples, double *out)
{
    for (int64_t n = 0; n < samples; n++) {
        double turned = fmod((double)(first + n) * carrier_hz, sample_rate_hz);
        double cycles = (turned < 0.0 ? turned + sample_rate_hz : turned) / sample_rate_hz;
        out[n] = peak_v * sqrt(drive[n]) * cos(TWO_PI * cycles);
    }
}
