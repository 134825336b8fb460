/* A lockstep client for the Siskin emulator, for C99 on POSIX systems; LOCKSTEP.md in the folder above describes the
 * datagrams. Calls return 0, or -1 with errno set if the emulator does not answer or refuses. */
#ifndef SISKIN_H
#define SISKIN_H

#include <arpa/inet.h>
#include <errno.h>
#include <stdint.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#define SISKIN_VERSION 1
#define SISKIN_ESCS 8
#define SISKIN_BYTES 65507
#define SISKIN_FRAMES 1024
#define SISKIN_DSHOT600 12
#define SISKIN_BIDIRECTIONAL_DSHOT600 22

/* State of an ESC and its motor, in the units of LOCKSTEP.md. */
struct siskin_esc {
    double rpm, angle_turns, torque_nm, currents_a[3], bus_a, bus_v, board_c;
    float reported_rpm, reported_bus_v, reported_bus_a, reported_c;
    uint32_t faults;
    uint8_t armed, phase;
    uint16_t answers;
};

struct siskin {
    int socket;
    uint32_t sequence;
    uint64_t time_ns;
    uint32_t refused, left_out;
    unsigned escs;
    struct siskin_esc esc[SISKIN_ESCS];
    /* The latest state as received, and where the answers begin in it. */
    uint8_t state[SISKIN_BYTES];
    size_t state_len, answers_at;
    /* The request under construction. */
    uint8_t request[SISKIN_BYTES];
    size_t request_len;
    unsigned frames;
};

/* An answer on the throttle wire. */
struct siskin_answer {
    unsigned esc;
    uint64_t asked_ns;
    const uint8_t *datagram;
    size_t len;
};

static inline void siskin_put(uint8_t *to, uint64_t value, int bytes) {
    for (int i = 0; i < bytes; i++) to[i] = (uint8_t)(value >> (8 * i));
}

static inline uint64_t siskin_get(const uint8_t *from, int bytes) {
    uint64_t value = 0;
    for (int i = 0; i < bytes; i++) value |= (uint64_t)from[i] << (8 * i);
    return value;
}

static inline double siskin_f64(const uint8_t *from) {
    uint64_t bits = siskin_get(from, 8);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline float siskin_f32(const uint8_t *from) {
    uint32_t bits = (uint32_t)siskin_get(from, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline void siskin_put_f64(uint8_t *to, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    siskin_put(to, bits, 8);
}

/* Parses the received state. */
static inline int siskin_read(struct siskin *s) {
    const uint8_t *b = s->state;
    if (s->state_len < 24 || b[0] != 40 || b[1] != SISKIN_VERSION || b[2] > SISKIN_ESCS
        || s->state_len < 24 + 96 * (size_t)b[2]) {
        errno = EPROTO;
        return -1;
    }
    s->escs = b[2];
    s->time_ns = siskin_get(b + 8, 8);
    s->refused = (uint32_t)siskin_get(b + 16, 4);
    s->left_out = (uint32_t)siskin_get(b + 20, 4);
    for (unsigned i = 0; i < s->escs; i++) {
        const uint8_t *e = b + 24 + 96 * i;
        struct siskin_esc *esc = &s->esc[i];
        esc->rpm = siskin_f64(e);
        esc->angle_turns = siskin_f64(e + 8);
        esc->torque_nm = siskin_f64(e + 16);
        for (int phase = 0; phase < 3; phase++) esc->currents_a[phase] = siskin_f64(e + 24 + 8 * phase);
        esc->bus_a = siskin_f64(e + 48);
        esc->bus_v = siskin_f64(e + 56);
        esc->board_c = siskin_f64(e + 64);
        esc->reported_rpm = siskin_f32(e + 72);
        esc->reported_bus_v = siskin_f32(e + 76);
        esc->reported_bus_a = siskin_f32(e + 80);
        esc->reported_c = siskin_f32(e + 84);
        esc->faults = (uint32_t)siskin_get(e + 88, 4);
        esc->armed = e[92];
        esc->phase = e[93];
        esc->answers = (uint16_t)siskin_get(e + 94, 2);
    }
    s->answers_at = 24 + 96 * (size_t)s->escs;
    return 0;
}

/* Sends the request until the state with this sequence number arrives; for `ask`, any state will do. */
static inline int siskin_call(struct siskin *s, uint32_t sequence, int ask) {
    for (int attempt = 0; attempt < 50; attempt++) {
        if (send(s->socket, s->request, s->request_len, 0) < 0 && errno != ECONNREFUSED) return -1;
        ssize_t got;
        while ((got = recv(s->socket, s->state, sizeof s->state, 0)) >= 24) {
            uint32_t refused = s->refused;
            s->state_len = (size_t)got;
            if (siskin_read(s) < 0) return -1;
            uint32_t told = (uint32_t)siskin_get(s->state + 4, 4);
            if (ask || told == sequence) {
                s->sequence = told;
                return 0;
            }
            if (s->refused != refused) {
                errno = EINVAL;
                return -1;
            }
        }
    }
    errno = ETIMEDOUT;
    return -1;
}

/* Connects to the first throttle wire, and asks where the sequence stands. */
static inline int siskin_open(struct siskin *s, const char *address, uint16_t port) {
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(port)};
    memset(s, 0, sizeof *s);
    if (inet_pton(AF_INET, address, &to.sin_addr) != 1) {
        errno = EINVAL;
        return -1;
    }
    s->socket = socket(AF_INET, SOCK_DGRAM, 0);
    if (s->socket < 0 || connect(s->socket, (struct sockaddr *)&to, sizeof to) < 0) return -1;
    struct timeval wait = {.tv_usec = 200000};
    if (setsockopt(s->socket, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait) < 0) return -1;
    s->request[0] = 43;
    s->request[1] = SISKIN_VERSION;
    s->request_len = 2;
    int told = siskin_call(s, 0, 1);
    s->request_len = 12;
    return told;
}

static inline void siskin_close(struct siskin *s) {
    close(s->socket);
}

/* Adds a throttle-wire datagram to the next advance; those of one ESC in order. */
static inline int siskin_frame(struct siskin *s, unsigned esc, uint32_t offset_ns, const uint8_t *datagram, uint16_t len) {
    uint8_t *at = s->request + s->request_len;
    if (s->frames == SISKIN_FRAMES || s->request_len + 8 + len > sizeof s->request) {
        errno = ENOBUFS;
        return -1;
    }
    at[0] = (uint8_t)esc;
    at[1] = 0;
    siskin_put(at + 2, len, 2);
    siskin_put(at + 4, offset_ns, 4);
    memcpy(at + 8, datagram, len);
    s->request_len += 8 + (size_t)len;
    s->frames++;
    return 0;
}

/* Adds a DShot frame in one of the wire's protocols: 0 is motor stop, 48 to 2047 are throttle. */
static inline int siskin_dshot(struct siskin *s, unsigned esc, uint32_t offset_ns, uint8_t protocol, unsigned value) {
    unsigned data = value << 1;
    unsigned check = (data ^ data >> 4 ^ data >> 8) & 0xF;
    unsigned bits = data << 4 | (protocol >= 20 ? check ^ 0xF : check);
    uint8_t datagram[3] = {protocol, (uint8_t)bits, (uint8_t)(bits >> 8)};
    return siskin_frame(s, esc, offset_ns, datagram, sizeof datagram);
}

/* Advances time, with the frames added so far. */
static inline int siskin_advance(struct siskin *s, uint32_t time_ns) {
    uint32_t sequence = s->sequence + 1;
    s->request[0] = 41;
    s->request[1] = SISKIN_VERSION;
    siskin_put(s->request + 2, s->frames, 2);
    siskin_put(s->request + 4, sequence, 4);
    siskin_put(s->request + 8, time_ns, 4);
    int told = siskin_call(s, sequence, 0);
    s->request_len = 12;
    s->frames = 0;
    return told;
}

/* Changes the ESCs' surroundings; NaN leaves a value unchanged. `shafts` has each ESC's torque, Nm, and air speed,
 * rpm, or is NULL. Call it before adding the frames of an advance. */
static inline int siskin_environment(struct siskin *s, double supply_v, double supply_ohm, double ambient_c, const double (*shafts)[2]) {
    uint32_t sequence = s->sequence + 1;
    unsigned count = shafts ? s->escs : 0;
    s->request[0] = 42;
    s->request[1] = SISKIN_VERSION;
    s->request[2] = (uint8_t)count;
    s->request[3] = 0;
    siskin_put(s->request + 4, sequence, 4);
    siskin_put_f64(s->request + 8, supply_v);
    siskin_put_f64(s->request + 16, supply_ohm);
    siskin_put_f64(s->request + 24, ambient_c);
    for (unsigned i = 0; i < count; i++) {
        siskin_put_f64(s->request + 32 + 16 * i, shafts[i][0]);
        siskin_put_f64(s->request + 40 + 16 * i, shafts[i][1]);
    }
    s->request_len = 32 + 16 * (size_t)count;
    int told = siskin_call(s, sequence, 0);
    s->request_len = 12;
    s->frames = 0;
    return told;
}

/* Reads the next answer of the latest advance, starting with `*at` and `*nth` of 0; returns -1 after the last. */
static inline int siskin_next(const struct siskin *s, size_t *at, unsigned *nth, struct siskin_answer *answer) {
    unsigned before = 0;
    size_t here = s->answers_at + *at;
    if (here + 10 > s->state_len) return -1;
    answer->esc = 0;
    while (answer->esc < s->escs && *nth >= before + s->esc[answer->esc].answers) before += s->esc[answer->esc++].answers;
    answer->asked_ns = siskin_get(s->state + here, 8);
    answer->len = (size_t)siskin_get(s->state + here + 8, 2);
    answer->datagram = s->state + here + 10;
    if (here + 10 + answer->len > s->state_len) return -1;
    *at += 10 + answer->len;
    ++*nth;
    return 0;
}

#endif
