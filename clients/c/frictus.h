/* frictus for C and C++, in headers alone: rigs over the WebSocket /v1/live of docs/websocket.md.
 *
 * For engines and their native plugins. Copy this file and frictus_connection.h; they need sockets
 * and the C99 library, nothing else (Windows: link Ws2_32). One connection belongs to one thread.
 *
 *     frictus rig;
 *     if (frictus_open(&rig, "127.0.0.1", 8420, NULL) || frictus_arm(&rig, "rig1", 3000))
 *         fail(rig.error);
 *     while (frictus_poll(&rig, 10, &event) >= 0) ...      call it often: it keeps the lease
 *     frictus_close(&rig);                                 disarms
 *
 * Functions return 0, or -1 with the reason in `error`; after a connection has ended every one
 * returns -1: it ends when the service closes it, or has sent nothing for 3 s of polling. Numbers
 * are written and read with a point, whatever the locale. Connections are not encrypted: use a
 * tunnel or a proxy that ends TLS.
 */
#ifndef FRICTUS_H
#define FRICTUS_H

#include "frictus_connection.h"

typedef enum { FRICTUS_TEXT, FRICTUS_SAMPLES, FRICTUS_FINGER } frictus_kind;

/* One message. What it points to holds until the next call with the same connection. */
typedef struct frictus_event {
    frictus_kind kind;
    const char *text;         /* FRICTUS_TEXT: JSON; see frictus_member */
    int stream;               /* 1 force N, 2 accel m/s2, 3 voltage V, 4 truth, 5 aux, 6 render */
    uint32_t run, columns, channels, samples_per_column;
    uint64_t first_sample;
    uint64_t lost;            /* samples, or states, missing before this */
    uint64_t utc_ns;          /* of the first, by the rig's clock */
    double sample_rate_hz;
    int extremes;             /* per channel `columns` minima, then as many maxima; else samples */
    const float *data;        /* FRICTUS_FINGER: 8 rows of `columns`; see frictus_finger_at */
} frictus_event;

/* What the sensors say of the finger at one device sample. */
typedef struct frictus_finger {
    uint64_t sample;
    float x_mm, y_mm, vx_mm_s, vy_mm_s, normal_force_n, age_ms;
    int in_contact, stale, extrapolated;
} frictus_finger;

/* Find a member of the outer object of a JSON text: where its value begins, and how long it is.
 * Enough for what the service sends, whose messages name a member once. */
static inline const char *frictus_member(const char *json, const char *name, size_t *length)
{
    int depth = 0, in_text = 0;
    size_t wanted = strlen(name);
    const char *at, *value = NULL;
    for (at = json; *at; at++) {
        if (in_text) {
            if (*at == '\\' && at[1])
                at++;
            else if (*at == '"')
                in_text = 0;
            continue;
        }
        if (value && depth == 1 && (*at == ',' || *at == '}')) {
            *length = (size_t)(at - value);
            return value;
        }
        if (*at == '"') {
            in_text = 1;
            if (!value && depth == 1 && !strncmp(at + 1, name, wanted) &&
                !strncmp(at + 1 + wanted, "\":", 2)) {
                in_text = 0;
                at += wanted + 2;
                value = at + 1;
            }
        } else if (*at == '{' || *at == '[') {
            depth++;
        } else if (*at == '}' || *at == ']') {
            depth--;
        }
    }
    return NULL;
}

/* Whether a member is this text. */
static inline int frictus_is(const char *json, const char *name, const char *text)
{
    size_t length = 0;
    const char *value = frictus_member(json, name, &length);
    return value && length == strlen(text) + 2 && value[0] == '"' &&
           !strncmp(value + 1, text, length - 2);
}

/* Read digits; `*at` is moved behind them. */
static inline double frictus_digits(const char **at, double number, int *count)
{
    for (*count = 0; **at >= '0' && **at <= '9'; ++*at, ++*count)
        number = 10.0 * number + (**at - '0');
    return number;
}

/* A member that is a number; `otherwise` where it is none. strtod would go by the locale. */
static inline double frictus_number(const char *json, const char *name, double otherwise)
{
    size_t length = 0;
    const char *value = frictus_member(json, name, &length), *at = value;
    double number, exponent = 0.0;
    int digits, decimals = 0;
    if (!value)
        return otherwise;
    at += *at == '-';
    number = frictus_digits(&at, 0.0, &digits);
    if (*at == '.') {
        at++;
        number = frictus_digits(&at, number, &decimals);
    }
    if (digits + decimals > 0 && (*at == 'e' || *at == 'E')) {
        int negative = at[1] == '-', any;
        at += at[1] == '-' || at[1] == '+' ? 2 : 1;
        exponent = frictus_digits(&at, 0.0, &any) * (negative ? -1.0 : 1.0);
        digits = any ? digits : -decimals; /* no digit behind the e: no number */
    }
    if (digits + decimals <= 0 || at != value + length)
        return otherwise;
    number *= pow(10.0, exponent - decimals);
    if (!(number <= 1e300))
        return otherwise;
    return *value == '-' ? -number : number;
}

/* Copy a member that is a text, without its quotes; escapes stay as they are. */
static inline void frictus_text(const char *json, const char *name, char *to, size_t room)
{
    size_t length = 0;
    const char *value = frictus_member(json, name, &length);
    to[0] = 0;
    if (value && length >= 2 && value[0] == '"') {
        length = length - 2 < room - 1 ? length - 2 : room - 1;
        memcpy(to, value + 1, length);
        to[length] = 0;
    }
}

static inline uint64_t frictus_bits(const char *at, size_t bytes)
{
    uint64_t value = 0;
    while (bytes-- > 0)
        value = value << 8 | (unsigned char)at[bytes];
    return value;
}

static inline void frictus_put(char *to, uint64_t value, size_t bytes)
{
    for (; bytes-- > 0; value >>= 8)
        *to++ = (char)(value & 0xff);
}

/* Read a binary message: 1 an event, 0 one of a later version that is passed over. */
static inline int frictus_decode(frictus *f, frictus_event *event)
{
    const char *at = f->message;
    uint64_t kind, rows;
    if (f->length < 56)
        return frictus_lost(f, "a binary message is too short for its header", "");
    if (frictus_bits(at, 2) != 1)
        return frictus_lost(f, "a binary message of another version: update this header", "");
    event->stream = (int)frictus_bits(at + 2, 2);
    event->channels = (uint32_t)frictus_bits(at + 4, 2);
    event->run = (uint32_t)frictus_bits(at + 8, 4);
    event->columns = (uint32_t)frictus_bits(at + 12, 4);
    event->first_sample = frictus_bits(at + 16, 8);
    event->lost = frictus_bits(at + 24, 8);
    {
        uint64_t rate = frictus_bits(at + 32, 8);
        memcpy(&event->sample_rate_hz, &rate, 8);
    }
    event->samples_per_column = (uint32_t)frictus_bits(at + 40, 4);
    kind = frictus_bits(at + 44, 4);
    event->utc_ns = frictus_bits(at + 48, 8);
    if (kind > 2)
        return 0;
    event->extremes = kind == 1;
    rows = (uint64_t)event->channels * (event->extremes ? 2 : 1);
    if (event->channels == 0 || (f->length - 56) % 4 != 0 ||
        rows * event->columns != (f->length - 56) / 4 ||
        (kind == 2 && event->channels < FRICTUS_FINGER_ROWS))
        return frictus_lost(f, "a binary message is not as long as its header says", "");
    event->kind = kind == 2 ? FRICTUS_FINGER : FRICTUS_SAMPLES;
    event->data = (const float *)(const void *)(at + 56); /* little-endian, as machines are */
    return 1;
}

/* One state of a FRICTUS_FINGER event; `index` below its `columns`. */
static inline frictus_finger frictus_finger_at(const frictus_event *event, uint32_t index)
{
    const float *row = event->data + index;
    size_t step = event->columns;
    float after = row[0], bits = row[7 * step];
    /* Casts of what is no number, or out of range, are undefined: such a state is stale. */
    int flags = bits >= 0.0f && bits < 65536.0f ? (int)bits : 2;
    frictus_finger finger;
    finger.sample = event->first_sample + (after >= 0.0f && after < 1e9f ? (uint64_t)after : 0);
    finger.x_mm = row[1 * step];
    finger.y_mm = row[2 * step];
    finger.vx_mm_s = row[3 * step];
    finger.vy_mm_s = row[4 * step];
    finger.normal_force_n = row[5 * step];
    finger.age_ms = row[6 * step];
    finger.in_contact = flags & 1;
    finger.stale = (flags >> 1) & 1;
    finger.extrapolated = (flags >> 2) & 1;
    return finger;
}

static inline void frictus_read_clock(frictus *f)
{
    double utc_us = frictus_number(f->message, "utc_us", 0.0);
    if (utc_us > 0.0 && utc_us < 9e15) /* casts of it hold */
        f->clock_us[f->clocks++ % FRICTUS_CLOCKS] = utc_us - frictus_now_us();
}

/* The service's clock, us since 1970: behind it by the fastest trip of a message, never ahead. */
static inline double frictus_utc_us(const frictus *f)
{
    unsigned index, known = f->clocks;
    double best = known ? f->clock_us[0] : 0.0;
    if (known > FRICTUS_CLOCKS)
        known = FRICTUS_CLOCKS;
    for (index = 1; index < known; index++)
        best = f->clock_us[index] > best ? f->clock_us[index] : best;
    return frictus_now_us() + best;
}

/* Note that nothing plays the stream any more: whoever goes on sending is to know. */
static inline void frictus_note_end(frictus *f)
{
    const char *why = "it was closed";
    char rig[65];
    if (!f->ticket)
        return;
    if (frictus_is(f->message, "op", "stream_closed")) {
        if (frictus_number(f->message, "ticket", 0.0) != f->ticket)
            return;
    } else if (frictus_is(f->message, "op", "disarmed")) {
        frictus_text(f->message, "rig", rig, sizeof rig);
        if (strcmp(rig, f->streaming))
            return;
        why = "the rig was given back";
    } else {
        return;
    }
    f->ticket = 0;
    frictus_text(f->message, "reason", f->ended, sizeof f->ended);
    if (!f->ended[0])
        snprintf(f->ended, sizeof f->ended, "%s", why);
}

/* Wait for the next message, at most timeout_ms. 1: an event, 0: none came, -1: it has ended.
 * Also keeps the lease: call it at least every second while a rig is armed. */
static inline int frictus_poll(frictus *f, int timeout_ms, frictus_event *event)
{
    double until_ms = frictus_now_us() / 1e3 + timeout_ms;
    int passed_over = 0;
    memset(event, 0, sizeof *event);
    for (;;) {
        double now_ms = frictus_now_us() / 1e3;
        int opcode, got, left_ms = until_ms > now_ms ? (int)(until_ms - now_ms) + 1 : 0;
        if (f->socket == FRICTUS_NO_SOCKET)
            return f->error[0] ? -1 : frictus_fail(f, "the connection has ended", "");
        if (passed_over && left_ms == 0)
            return 0;
        if (f->clocks && fabs(now_ms - f->pinged_ms) > FRICTUS_PING_MS) {
            char ping[64];
            f->pinged_ms = now_ms;
            if (f->quiet++ >= FRICTUS_QUIET_PINGS)
                return frictus_lost(f, "the service has fallen silent", "");
            snprintf(ping, sizeof ping, "{\"op\":\"ping\",\"id\":0}");
            if (frictus_say(f, ping))
                return -1;
        }
        opcode = frictus_take(f);
        if (opcode == -1)
            return -1;
        if (opcode == 1) {
            event->kind = FRICTUS_TEXT;
            event->text = f->message;
            frictus_read_clock(f);
            frictus_note_end(f);
            if (!frictus_is(f->message, "op", "pong"))
                return 1;
            passed_over = 1;
        } else if (opcode == 2) {
            if ((got = frictus_decode(f, event)) != 0)
                return got;
            passed_over = 1;
        } else if (opcode == -2) {
            got = frictus_receive(f, left_ms < FRICTUS_PING_MS ? left_ms : FRICTUS_PING_MS);
            if (got < 0 || (got == 0 && left_ms <= FRICTUS_PING_MS))
                return got;
        } else if (opcode > 2 && opcode < 8) {
            return frictus_lost(f, "a frame of an unknown kind", "");
        } else {
            passed_over = 1; /* a ping, a pong */
        }
    }
}

/* Send a request `{"op":...}` without its last brace, and wait for the answer `op`, whose text
 * is left in `event`. What else comes meanwhile is passed over. */
static inline int frictus_ask(frictus *f, const char *request, const char *op,
                              frictus_event *event)
{
    double due_ms = frictus_now_us() / 1e3 + FRICTUS_ANSWER_MS, id = (double)++f->requests;
    char text[4096], why[200] = "";
    int size = snprintf(text, sizeof text, "%s,\"id\":%.0f}", request, id);
    if (size < 0 || (size_t)size >= sizeof text)
        return frictus_fail(f, "the request is too long", "");
    if (frictus_say(f, text))
        return -1;
    while (frictus_now_us() / 1e3 < due_ms) {
        int got = frictus_poll(f, 100, event);
        f->quiet = 0; /* while it arms a rig it sends no pongs */
        int answers, refused;
        if (got < 0) /* what is out of range is refused without its id, and closes */
            return why[0] ? frictus_fail(f, "refused: ", why) : -1;
        if (!got || event->kind != FRICTUS_TEXT)
            continue;
        answers = frictus_number(event->text, "id", -1.0) == id;
        refused = frictus_is(event->text, "op", "refused");
        if (answers && frictus_is(event->text, "op", op))
            return 0;
        if (refused && (answers || frictus_number(event->text, "id", -1.0) < 0.0))
            frictus_text(event->text, "message", why, sizeof why);
        if (refused && answers)
            return frictus_fail(f, "refused: ", why);
    }
    return frictus_fail(f, "the service has not answered: ", op);
}

/* Connect to a service; `token` may be NULL where it has none. */
static inline int frictus_open(frictus *f, const char *host, int port, const char *token)
{
    char hello[1200], why[200], quoted[1010] = "null";
    frictus_event event;
    int got;
    memset(f, 0, sizeof *f);
    f->socket = FRICTUS_NO_SOCKET;
    f->noise = (uint32_t)(uint64_t)frictus_now_us() ^ (uint32_t)(uintptr_t)f ^ 0x9e3779b9u;
    f->noise |= 1;
#ifdef _WIN32
    {
        WSADATA started;
        if (WSAStartup(MAKEWORD(2, 2), &started))
            return frictus_fail(f, "Winsock does not start", "");
    }
#endif
    if (token) {
        if (strlen(token) > 1000 || strcspn(token, "\"\\\r\n\t") != strlen(token))
            return frictus_fail(f, "a token has at most 1000 bytes and no quotes", "");
        snprintf(quoted, sizeof quoted, "\"%s\"", token);
    }
    if (frictus_dial(f, host, port) || frictus_shake(f, host, port))
        return -1;
    snprintf(hello, sizeof hello, "{\"op\":\"hello\",\"version\":1,\"token\":%s}", quoted);
    if (frictus_say(f, hello))
        return -1;
    if ((got = frictus_poll(f, FRICTUS_ANSWER_MS, &event)) <= 0)
        return got ? -1 : frictus_lost(f, "the service does not answer hello", "");
    if (event.kind != FRICTUS_TEXT || !frictus_is(event.text, "op", "welcome")) {
        frictus_text(event.kind == FRICTUS_TEXT ? event.text : "{}", "message", why, sizeof why);
        return frictus_lost(f, "refused: ", why);
    }
    frictus_text(event.text, "protocol", why, sizeof why);
    if (strncmp(why, "1.", 2) || atoi(why + 2) < 1)
        return frictus_lost(f, "the service speaks another version than 1.1: ", why);
    frictus_text(event.text, "client", f->client, sizeof f->client);
    return 0;
}

/* Be told of a rig: `streams` as in JSON, such as "\"force\",\"accel\""; all states of the finger
 * where `fingers`. Samples come raw where samples_per_column is 1, else as extremes. */
static inline int frictus_watch(frictus *f, const char *rig, const char *streams,
                                unsigned samples_per_column, int fingers)
{
    char text[1024];
    snprintf(text, sizeof text,
             "{\"op\":\"watch\",\"rig\":\"%.64s\",\"streams\":[%.400s],\"fingers\":%s,"
             "\"raw\":%s,\"samples_per_column\":%u}",
             rig, streams, fingers ? "true" : "false",
             samples_per_column == 1 ? "true" : "false", samples_per_column);
    return frictus_say(f, text);
}

/* Take a rig and let it drive its screen while this connection is polled; lease 500 to 10000. */
static inline int frictus_arm(frictus *f, const char *rig, unsigned lease_ms)
{
    char text[256];
    frictus_event event;
    snprintf(text, sizeof text, "{\"op\":\"arm\",\"rig\":\"%.64s\",\"lease_ms\":%u", rig, lease_ms);
    return frictus_ask(f, text, "armed", &event);
}

/* Ramp the output to zero and give the rig back. */
static inline int frictus_disarm(frictus *f, const char *rig)
{
    char text[256];
    frictus_event event;
    snprintf(text, sizeof text, "{\"op\":\"disarm\",\"rig\":\"%.64s\"", rig);
    return frictus_ask(f, text, "disarmed", &event);
}

/* Open a texture stream; peak_n is the largest |friction| that will be sent, up to 10 N. */
static inline int frictus_open_stream(frictus *f, const char *rig, double peak_n)
{
    char text[256];
    frictus_event event;
    uint64_t nano;
    double ticket;
    if (!(peak_n >= 1e-6 && peak_n <= 10.0)) /* refuses NaN, too */
        return frictus_fail(f, "peak_n: 1e-6 to 10 N", "");
    nano = (uint64_t)(peak_n * 1e9 + 0.5);
    snprintf(text, sizeof text,
             "{\"op\":\"open_stream\",\"rig\":\"%.64s\",\"peak_n\":%u.%09u", rig,
             (unsigned)(nano / 1000000000u), (unsigned)(nano % 1000000000u));
    if (frictus_ask(f, text, "stream_opened", &event))
        return -1;
    ticket = frictus_number(event.text, "ticket", 0.0);
    if (!(ticket >= 1.0 && ticket <= 4294967295.0))
        return frictus_fail(f, "the service gave no ticket", "");
    f->ticket = (uint32_t)ticket;
    f->peak_n = peak_n;
    snprintf(f->streaming, sizeof f->streaming, "%.64s", rig);
    f->ended[0] = 0;
    f->updates = 0;
    return 0;
}

/* Send one period of friction, N; the rig cross-fades to it. The period is in mm over position,
 * or, where `over_time`, in s. count: 2 to 4096. -1 once the stream has ended, as when somebody
 * stops the rig: `error` says who, and nothing is felt of what is sent. */
static inline int frictus_update(frictus *f, const float *friction_n, size_t count, double period,
                                 int over_time, double angle_deg, unsigned ttl_ms)
{
    char bytes[64 + 4 * 4096];
    double least = over_time ? 1e-4 : 1e-3, most = over_time ? 10.0 : 1000.0;
    uint64_t field;
    size_t at;
    if (!f->ticket && f->ended[0])
        return frictus_fail(f, "the stream has ended: ", f->ended);
    if (!f->ticket)
        return frictus_fail(f, "open a texture stream first", "");
    if (count < 2 || count > 4096)
        return frictus_fail(f, "2 to 4096 samples are one period", "");
    /* The service would end the connection over these, and with it the lease. NaN fails, too. */
    for (at = 0; at < count; at++)
        if (!(fabs((double)friction_n[at]) <= f->peak_n * (1.0 + 1e-6)))
            return frictus_fail(f, "friction: finite and within the declared peak", "");
    if (!(period >= least && period <= most))
        return frictus_fail(f, over_time ? "period: 1e-4 to 10 s" : "period: 1e-3 to 1000 mm", "");
    if (!(fabs(angle_deg) <= 360.0) || ttl_ms < 1 || ttl_ms > 60000)
        return frictus_fail(f, "angle_deg: -360 to 360; ttl_ms: 1 to 60000", "");
    memset(bytes, 0, 64);
    memcpy(bytes, "FRTX", 4);
    frictus_put(bytes + 4, 1, 2);
    frictus_put(bytes + 6, over_time ? 1 : 0, 2);
    frictus_put(bytes + 8, f->ticket, 4);
    frictus_put(bytes + 12, count, 4);
    frictus_put(bytes + 16, f->updates, 8);
    frictus_put(bytes + 24, (uint64_t)frictus_utc_us(f) * 1000, 8);
    frictus_put(bytes + 32, ttl_ms, 4);
    memcpy(&field, &period, 8);
    frictus_put(bytes + 40, field, 8);
    memcpy(&field, &angle_deg, 8);
    frictus_put(bytes + 48, field, 8);
    memcpy(bytes + 64, friction_n, 4 * count);
    if (frictus_send(f, 2, bytes, 64 + 4 * count))
        return -1;
    f->updates++;
    return 0;
}

/* End the texture stream; the rig fades to its scene. `event` has what became of the updates. */
static inline int frictus_close_stream(frictus *f, frictus_event *event)
{
    f->ticket = 0;
    f->ended[0] = 0;
    return frictus_ask(f, "{\"op\":\"close_stream\"", "stream_closed", event);
}

#endif
