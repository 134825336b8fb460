/* A clock and a network for Betaflight's SITL, preloaded into it and controlled by a test.
 *
 * The program takes its time from a clock that runs only as far as the test grants, gets its state and its sticks
 * from the test, and returns its motors' outputs: all through one connected stream socket, whose number is in
 * HELD_LINK. None of its fixed ports is opened. What it does then only depends on what the test sends.
 *
 * Its main thread computes; two others each take a packet and hand it over. They run in turn: the main thread waits
 * at the end of its grant, the packets are handed over, it continues. Its fourth thread serves the command line on
 * a loopback port of the system's choosing, and has no part in a flight.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* As in Betaflight. */
enum { MOTORS_PORT = 9001, STATE_PORT = 9003, STICKS_PORT = 9004, COMMAND_LINE_PORT = 5761 };
enum { MOTORS_SIZE = 68, STATE_SIZE = 144, STICKS_SIZE = 40 };

/* Time that reading the clock takes: a loop that waits for a time ends, and tasks take some. */
enum { LOOK_NS = 100 };

/* It starts by itself, without packets; then the test controls it. */
enum { START_NS = 1000000000 };

/* From the test: how far the clock may run, in ns, and what is handed over first. Ends with the stream. */
struct grant {
    uint64_t until_ns;
    uint8_t state[STATE_SIZE], sticks[STICKS_SIZE];
};

/* To the test: the clock, when the motors' outputs were last written, and those. */
struct report {
    uint64_t now_ns, written_ns;
    uint8_t motors[MOTORS_SIZE];
    uint16_t command_line_port, reserved;
};

/* A packet waiting for its thread: empty, full, or taken while the thread works on it. */
struct box {
    int socket;
    enum { EMPTY, FULL, TAKEN } is;
    const void *packet;
    size_t size;
};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static struct box state = {.socket = -1}, sticks = {.socket = -1};
static struct report report;
static uint64_t granted_ns = START_NS;
static int began, waiting, link_to_test;
static pthread_t computes;
static _Thread_local int waits;

static int (*next_bind)(int, const struct sockaddr *, socklen_t);
static int (*next_create)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
static int (*next_nanosleep)(const struct timespec *, struct timespec *);
static int (*next_select)(int, fd_set *, fd_set *, fd_set *, struct timeval *);
static ssize_t (*next_recvfrom)(int, void *, size_t, int, struct sockaddr *, socklen_t *);

static void __attribute__((constructor)) begin(void)
{
    const char *link = getenv("HELD_LINK");
    if (!link)
        abort();
    link_to_test = atoi(link);
    computes = pthread_self();
    next_bind = dlsym(RTLD_NEXT, "bind");
    next_create = dlsym(RTLD_NEXT, "pthread_create");
    next_nanosleep = dlsym(RTLD_NEXT, "nanosleep");
    next_select = dlsym(RTLD_NEXT, "select");
    next_recvfrom = dlsym(RTLD_NEXT, "recvfrom");
}

static int is_main(void)
{
    return pthread_equal(pthread_self(), computes);
}

/* Called with the lock held. Returns once the thread has dealt with the packet. */
static void hand_over(struct box *box, const void *packet, size_t size)
{
    box->packet = packet;
    box->size = size;
    box->is = FULL;
    pthread_cond_broadcast(&changed);
    while (box->is != EMPTY)
        pthread_cond_wait(&changed, &lock);
}

/* Asks for the next grant at the end of the last one. */
static void ask(void)
{
    struct grant grant;
    if (send(link_to_test, &report, sizeof report, MSG_NOSIGNAL) != sizeof report ||
        recv(link_to_test, &grant, sizeof grant, MSG_WAITALL) != sizeof grant)
        _exit(0);
    pthread_mutex_lock(&lock);
    began = 1;
    hand_over(&state, grant.state, sizeof grant.state);
    hand_over(&sticks, grant.sticks, sizeof grant.sticks);
    pthread_mutex_unlock(&lock);
    granted_ns = grant.until_ns;
}

int clock_gettime(clockid_t clock, struct timespec *time)
{
    (void)clock;
    if (is_main())
        report.now_ns += LOOK_NS;
    time->tv_sec = report.now_ns / 1000000000;
    time->tv_nsec = report.now_ns % 1000000000;
    return 0;
}

int nanosleep(const struct timespec *time, struct timespec *left)
{
    if (!is_main())
        return next_nanosleep(time, left);
    report.now_ns += time->tv_sec * UINT64_C(1000000000) + time->tv_nsec;
    while (report.now_ns >= granted_ns)
        ask();
    return 0;
}

/* Each thread reaches its first wait before the next one starts. */
int pthread_create(pthread_t *thread, const pthread_attr_t *how, void *(*run)(void *), void *argument)
{
    pthread_mutex_lock(&lock);
    int all = waiting + 1, failed = next_create(thread, how, run, argument);
    while (!failed && waiting < all)
        pthread_cond_wait(&changed, &lock);
    pthread_mutex_unlock(&lock);
    return failed;
}

static struct box *box_of(int socket)
{
    return socket == state.socket ? &state : socket == sticks.socket ? &sticks : NULL;
}

/* For two threads only a packet ends the wait; the command line begins once the program has started. */
int select(int count, fd_set *read, fd_set *write, fd_set *except, struct timeval *timeout)
{
    struct box *box = read && count > 0 && FD_ISSET(count - 1, read) ? box_of(count - 1) : NULL;
    pthread_mutex_lock(&lock);
    if (!waits) {
        waits = 1;
        waiting++;
    }
    if (box && box->is == TAKEN)
        box->is = EMPTY;
    pthread_cond_broadcast(&changed);
    while (box ? box->is != FULL : !began)
        pthread_cond_wait(&changed, &lock);
    pthread_mutex_unlock(&lock);
    return box ? 1 : next_select(count, read, write, except, timeout);
}

ssize_t recvfrom(int socket, void *data, size_t size, int flags, struct sockaddr *from, socklen_t *length)
{
    struct box *box = box_of(socket);
    if (!box)
        return next_recvfrom(socket, data, size, flags, from, length);
    pthread_mutex_lock(&lock);
    size = size < box->size ? size : box->size;
    memcpy(data, box->packet, size);
    box->is = TAKEN;
    pthread_mutex_unlock(&lock);
    return size;
}

static uint16_t port_of(const struct sockaddr *address)
{
    return ntohs(((const struct sockaddr_in *)address)->sin_port);
}

ssize_t sendto(int socket, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t length)
{
    (void)socket, (void)flags, (void)length;
    if (port_of(to) == MOTORS_PORT && size == MOTORS_SIZE) {
        memcpy(report.motors, data, size);
        report.written_ns = report.now_ns;
    }
    return size;
}

/* Each port becomes one of the system's choosing, on loopback. */
int bind(int socket, const struct sockaddr *address, socklen_t length)
{
    uint16_t port = port_of(address);
    union {
        struct sockaddr any;
        struct sockaddr_in v4;
        struct sockaddr_in6 v6;
    } own = {.any.sa_family = address->sa_family};
    if (own.any.sa_family == AF_INET6)
        inet_pton(AF_INET6, "::ffff:127.0.0.1", &own.v6.sin6_addr);
    else
        own.v4.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (port == STATE_PORT)
        state.socket = socket;
    else if (port == STICKS_PORT)
        sticks.socket = socket;
    int failed = next_bind(socket, &own.any, length);
    if (!failed && port == COMMAND_LINE_PORT && !getsockname(socket, &own.any, &length))
        report.command_line_port = port_of(&own.any);
    return failed;
}

/* The program only waits for its threads when it ends, and they wait for packets. */
int pthread_join(pthread_t thread, void **result)
{
    (void)thread, (void)result;
    exit(0);
}
