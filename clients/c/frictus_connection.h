/* The connection under frictus.h: sockets, the WebSocket handshake and its frames (RFC 6455).
 *
 * What Sec-WebSocket-Accept says is not looked at: it proves to browsers only that the other end
 * speaks WebSocket, which the welcome proves, too.
 */
#ifndef FRICTUS_CONNECTION_H
#define FRICTUS_CONNECTION_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifdef _WIN32
#include <winsock2.h>
#include <ws2tcpip.h>
typedef SOCKET frictus_socket;
#define FRICTUS_NO_SOCKET INVALID_SOCKET
#define frictus_close_socket closesocket
#define FRICTUS_NO_SIGNAL 0
#else
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>
typedef int frictus_socket;
#define FRICTUS_NO_SOCKET (-1)
#define frictus_close_socket close
#ifdef MSG_NOSIGNAL
#define FRICTUS_NO_SIGNAL MSG_NOSIGNAL
#else
#define FRICTUS_NO_SIGNAL 0
#endif
#endif

enum {
    FRICTUS_MAX_MESSAGE = 4 << 20, /* bytes of one message; longer ones end the connection */
    FRICTUS_READ = 1 << 16,        /* bytes asked for at once: many small reads are slow */
    FRICTUS_CLOCKS = 16,
    FRICTUS_PING_MS = 500,
    FRICTUS_QUIET_PINGS = 6,       /* a service that sends nothing for so many is taken for dead */
    FRICTUS_ANSWER_MS = 10000,
    FRICTUS_FINGER_ROWS = 8
};

/* What a connection knows. Read `error`, `client` and the counts; leave the rest. */
typedef struct frictus {
    char error[256];
    char client[80];          /* the name under which rigs know us */
    uint32_t ticket;          /* of the open texture stream; 0: none */
    double peak_n;            /* the largest friction that was announced for that stream */
    char streaming[65];       /* the rig of that stream */
    char ended[200];          /* why it has ended; empty while it is played */
    uint64_t updates;         /* sent over it */
    frictus_socket socket;
    char *in;                 /* received, not yet taken: [taken, filled) of `room` bytes */
    size_t taken, filled, room;
    char *message;            /* the newest message, whole and ended by a zero */
    size_t length, message_room;
    double clock_us[FRICTUS_CLOCKS];
    unsigned clocks;
    double pinged_ms;
    int quiet;                /* pings since something was received */
    uint64_t requests;
    uint32_t noise;
} frictus;

static inline double frictus_now_us(void)
{
#ifdef _WIN32
    FILETIME now;
    GetSystemTimeAsFileTime(&now);
    return (((double)now.dwHighDateTime * 4294967296.0 + now.dwLowDateTime) / 10.0) -
           11644473600e6;
#else
    struct timeval now;
    gettimeofday(&now, NULL);
    return 1e6 * (double)now.tv_sec + (double)now.tv_usec;
#endif
}

static inline int frictus_fail(frictus *f, const char *what, const char *detail)
{
    snprintf(f->error, sizeof f->error, "%s%.*s", what, 180, detail);
    return -1;
}

/* End a connection, whatever it is in; the rig that it holds is disarmed. Twice is harmless. */
static inline void frictus_close(frictus *f)
{
    if (f->socket != FRICTUS_NO_SOCKET) {
        frictus_close_socket(f->socket);
        f->socket = FRICTUS_NO_SOCKET;
    }
    free(f->in);
    free(f->message);
    f->in = f->message = NULL;
    f->taken = f->filled = f->room = f->length = f->message_room = 0;
    f->ticket = 0;
}

static inline int frictus_lost(frictus *f, const char *what, const char *detail)
{
    frictus_fail(f, what, detail);
    frictus_close(f);
    return -1;
}

static inline int frictus_send_all(frictus *f, const char *bytes, size_t count)
{
    if (f->socket == FRICTUS_NO_SOCKET)
        return f->error[0] ? -1 : frictus_fail(f, "the connection has ended", "");
    while (count > 0) {
        int sent = (int)send(f->socket, bytes, (int)(count > 65536 ? 65536 : count),
                             FRICTUS_NO_SIGNAL);
        if (sent <= 0)
            return frictus_lost(f, "the connection is lost while sending", "");
        bytes += sent;
        count -= (size_t)sent;
    }
    return 0;
}

/* Send a frame: opcode 1 text, 2 binary, 9 ping, 10 pong. Masked, as clients must. */
static inline int frictus_send(frictus *f, int opcode, const void *payload, size_t count)
{
    unsigned char head[14];
    size_t size = 2, at;
    char *frame;
    int sent;
    if (count > 65535)
        return frictus_fail(f, "a message has at most 65535 bytes", "");
    head[0] = (unsigned char)(0x80 | opcode);
    if (count < 126) {
        head[1] = (unsigned char)(0x80 | count);
    } else {
        head[1] = 0x80 | 126;
        head[2] = (unsigned char)(count >> 8);
        head[3] = (unsigned char)count;
        size = 4;
    }
    f->noise ^= f->noise << 13; /* xorshift32 */
    f->noise ^= f->noise >> 17;
    f->noise ^= f->noise << 5;
    memcpy(head + size, &f->noise, 4);
    if (!(frame = (char *)malloc(size + 4 + count)))
        return frictus_fail(f, "no memory", "");
    memcpy(frame, head, size + 4);
    for (at = 0; at < count; at++)
        frame[size + 4 + at] = (char)(((const unsigned char *)payload)[at] ^ head[size + at % 4]);
    sent = frictus_send_all(f, frame, size + 4 + count);
    free(frame);
    return sent;
}

static inline int frictus_say(frictus *f, const char *json)
{
    return frictus_send(f, 1, json, strlen(json));
}

/* Wait for bytes. 1: some came, 0: none within timeout_ms. */
static inline int frictus_receive(frictus *f, int timeout_ms)
{
    fd_set readable;
    struct timeval timeout;
    int got;
    if (f->socket == FRICTUS_NO_SOCKET)
        return f->error[0] ? -1 : frictus_fail(f, "the connection has ended", "");
    timeout.tv_sec = timeout_ms / 1000;
    timeout.tv_usec = 1000 * (timeout_ms % 1000);
    FD_ZERO(&readable);
#ifndef _WIN32
    if (f->socket >= FD_SETSIZE)
        return frictus_lost(f, "too many open files for select", "");
#endif
    FD_SET(f->socket, &readable);
    got = select((int)f->socket + 1, &readable, NULL, NULL, &timeout);
    if (got <= 0)
        return got ? frictus_lost(f, "the connection is lost while waiting", "") : 0;
    if (f->taken > 0) {
        memmove(f->in, f->in + f->taken, f->filled - f->taken);
        f->filled -= f->taken;
        f->taken = 0;
    }
    if (f->room - f->filled < FRICTUS_READ) {
        char *more = (char *)realloc(f->in, f->room + f->room / 2 + FRICTUS_READ);
        if (!more)
            return frictus_lost(f, "no memory", "");
        f->in = more;
        f->room += f->room / 2 + FRICTUS_READ;
    }
    got = (int)recv(f->socket, f->in + f->filled, FRICTUS_READ, 0);
    if (got <= 0)
        return frictus_lost(f, "the service has closed the connection", "");
    f->filled += (size_t)got;
    f->quiet = 0;
    return 1;
}

/* Take one frame that has come whole: its opcode where it is a message, 0 where it was a ping or
 * pong; -2: none has. */
static inline int frictus_take(frictus *f)
{
    const unsigned char *at = (const unsigned char *)f->in + f->taken;
    size_t held = f->filled - f->taken, head = 2, size, index;
    int opcode, control;
    if (held < 2)
        return -2;
    opcode = at[0] & 0x0f;
    control = opcode >= 8;
    size = at[1] & 0x7f;
    if ((at[0] & 0x70) || (at[1] & 0x80))
        return frictus_lost(f, "a frame that no service sends: is this a WebSocket?", "");
    if (size >= 126) {
        size_t digits = size == 126 ? 2 : 8;
        if (held < 2 + digits)
            return -2;
        for (size = 0, index = 0; index < digits; index++) {
            if (size > FRICTUS_MAX_MESSAGE)
                break;
            size = size << 8 | at[2 + index];
        }
        head += digits;
    }
    if (size > FRICTUS_MAX_MESSAGE)
        return frictus_lost(f, "a message is larger than FRICTUS_MAX_MESSAGE", "");
    if (held < head + size)
        return -2;
    if (control) {
        f->taken += head + size;
        if (opcode == 8) {
            char reason[126] = "";
            if (size > 2 && size < 126)
                memcpy(reason, at + head + 2, size - 2);
            return frictus_lost(f, "the service has closed the connection: ", reason);
        }
        if (opcode == 9 && frictus_send(f, 10, at + head, size))
            return -1;
        return 0;
    }
    if (!(at[0] & 0x80) || opcode == 0)
        return frictus_lost(f, "the service sends messages in one frame each", "");
    if (size + 1 > f->message_room) {
        char *more = (char *)realloc(f->message, size + 1);
        if (!more)
            return frictus_lost(f, "no memory", "");
        f->message = more;
        f->message_room = size + 1;
    }
    memcpy(f->message, at + head, size);
    f->message[size] = 0;
    f->length = size;
    f->taken += head + size;
    return opcode;
}

static inline int frictus_shake(frictus *f, const char *host, int port)
{
    char asked[512];
    int got = 1;
    snprintf(asked, sizeof asked,
             "GET /v1/live HTTP/1.1\r\nHost: %.200s:%d\r\nUpgrade: websocket\r\n"
             "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
             "Sec-WebSocket-Key: ZnJpY3R1cyBpcyBub2lzeQ==\r\n\r\n",
             host, port);
    if (frictus_send_all(f, asked, strlen(asked)))
        return -1;
    for (;;) {
        size_t at;
        for (at = 3; at < f->filled; at++)
            if (!memcmp(f->in + at - 3, "\r\n\r\n", 4))
                break;
        if (at < f->filled) {
            if (f->filled < 12 || memcmp(f->in, "HTTP/1.1 101", 12)) {
                f->in[at - 3] = 0;
                return frictus_lost(f, "no WebSocket there: ", f->in);
            }
            f->taken = at + 1;
            return 0;
        }
        if (f->filled > 16384)
            return frictus_lost(f, "no WebSocket there: its answer has no end", "");
        if ((got = frictus_receive(f, FRICTUS_ANSWER_MS)) <= 0)
            return got ? -1 : frictus_lost(f, "the service does not answer", "");
    }
}

static inline int frictus_dial(frictus *f, const char *host, int port)
{
    struct addrinfo hints, *found = NULL, *one;
    char digits[16];
    int yes = 1;
    memset(&hints, 0, sizeof hints);
    hints.ai_socktype = SOCK_STREAM;
    snprintf(digits, sizeof digits, "%d", port);
    if (getaddrinfo(host, digits, &hints, &found))
        return frictus_fail(f, "no such host: ", host);
    for (one = found; one && f->socket == FRICTUS_NO_SOCKET; one = one->ai_next) {
        f->socket = socket(one->ai_family, one->ai_socktype, one->ai_protocol);
        if (f->socket != FRICTUS_NO_SOCKET &&
            connect(f->socket, one->ai_addr, (socklen_t)one->ai_addrlen)) {
            frictus_close_socket(f->socket);
            f->socket = FRICTUS_NO_SOCKET;
        }
    }
    freeaddrinfo(found);
    if (f->socket == FRICTUS_NO_SOCKET)
        return frictus_fail(f, "nobody listens at ", host);
    setsockopt(f->socket, IPPROTO_TCP, TCP_NODELAY, (const char *)&yes, sizeof yes);
    return 0;
}

#endif
