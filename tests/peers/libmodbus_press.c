/* A press on libmodbus with its own stroke logic: a second server stack to run a host against. It serves one
 * connection at a time, as small controllers do; a new client takes the place of the old one.
 *
 *     apt-get install libmodbus-dev gcc pkg-config
 *     gcc -std=c11 -Wall -Wextra -O2 libmodbus_press.c -o libmodbus_press $(pkg-config --cflags --libs libmodbus)
 *     ./libmodbus_press -n 20                    TCP on a port that the system chooses
 *     ./libmodbus_press -n 20 -s /dev/pts/7      RTU, 115200 baud, even parity
 *
 * The first line on stdout is {"port": N}, the last a summary; the exit code is 0 when every stroke got its result
 * and nothing was wrong. Registers: plate press - host, version 1, P block at 0, H block at 100, unit 1.
 */
#define _POSIX_C_SOURCE 200809L
#include <arpa/inet.h>
#include <errno.h>
#include <modbus.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <time.h>
#include <unistd.h>

enum { P = 0, H = 100, SIZE = 200, UNIT = 1, RECIPE = 17, PRESS_ID = 3 };
enum { ENABLE = 1, TRIGGER = 2, ACK = 4, CLEAR = 32, PART_END = 128, BASELINE = 512 };
enum { READY = 1, BUSY = 2, VALID = 4, PASS = 8, FAIL = 16, NOT_MEASURED = 4096, CANNOT_TELL = 8192 };
enum state { WAIT_READY, RAM, WAIT_ECHO, WAIT_RESULT, WAIT_CLEAR, LEAVING, DONE };

static uint16_t *words; /* the holding registers */
static uint16_t taken[1024][64];
static int n_taken, n_wrong, n_writes, n_outside, n_before_sync, n_duplicates, n_lost;
static bool read_p, read_h;
static int64_t host_beat_ms = -1;
static uint16_t host_beat;
static uint16_t published_stroke, published_seq;

static int64_t now_ms(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

static void wrong(uint16_t stroke, const char *what) {
    n_wrong++;
    fprintf(stderr, "stroke %u: %s\n", stroke, what);
}

static uint16_t crc_word(uint16_t crc, uint16_t word) {
    const uint8_t bytes[2] = {word >> 8, word & 255};
    for (int i = 0; i < 2; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) crc = crc & 1 ? (crc >> 1) ^ 0xA001 : crc >> 1;
    }
    return crc;
}

static uint16_t block_crc(const uint16_t *h) {
    uint16_t crc = 0xFFFF;
    for (int i = 3; i <= 51; i++) crc = crc_word(crc, h[i]);
    for (int i = 55; i <= 61; i++) crc = crc_word(crc, h[i]);
    return crc;
}

/* Before libmodbus serves a request: what does it touch? */
static void look_at_request(const uint8_t *pdu) {
    const int address = pdu[1] << 8 | pdu[2], count = pdu[3] << 8 | pdu[4];
    switch (pdu[0]) {
    case 3:
        read_p |= address < P + 32;
        read_h |= address < H + 64 && address + count > H;
        break;
    case 6:
    case 16: {
        const int last = pdu[0] == 6 ? address : address + count - 1;
        n_writes++;
        n_outside += address < H || last >= H + 64;
        n_before_sync += !(read_p && read_h);
        break;
    }
    default:
        wrong(0, "a function other than 3, 6 and 16");
    }
}

/* After each write: heartbeat, second publications. */
static void look_at_host(void) {
    const uint16_t *h = words + H;
    if (h[1] != host_beat || host_beat_ms < 0) {
        host_beat = h[1];
        host_beat_ms = now_ms();
    }
    if ((h[2] & VALID) && h[8] == h[53]) {
        if (published_stroke == h[4] && published_seq != h[8]) n_duplicates++;
        published_stroke = h[4];
        published_seq = h[8];
    }
}

static void judge(const uint16_t *h) {
    const uint16_t verdicts = h[2] & (PASS | FAIL | NOT_MEASURED | CANNOT_TELL);
    if (verdicts == 0 || verdicts & (verdicts - 1)) wrong(h[4], "not exactly one verdict");
    if (h[2] & BUSY) wrong(h[4], "valid and busy at once");
    if (h[52] != block_crc(h)) wrong(h[4], "check sum");
    if (h[48] != RECIPE) wrong(h[4], "recipe");
    if (h[10] != 0x8000 && h[11] != 0x8000 && (int16_t)h[10] < (int16_t)h[11]) wrong(h[4], "deviation upside down");
    if (h[2] & NOT_MEASURED && h[55] != 0xFFFF) wrong(h[4], "not measured, yet a gap");
}

/* The press, called every few milliseconds. */
static enum state cycle(enum state state, int strokes, int64_t *since, uint16_t *stroke, int64_t limit_ms) {
    uint16_t *p = words + P, *h = words + H;
    const int64_t now = now_ms(), waited = now - *since;
    const bool alive = host_beat_ms >= 0 && now - host_beat_ms < 2000;
    enum state next = state;

    p[1] = (uint16_t)(now / 250);
    switch (state) {
    case WAIT_READY:
        if (alive && h[2] & READY) next = RAM;
        break;
    case RAM: /* the first request is the baseline: no bend */
        p[2] = ENABLE | (waited < 20 ? 0 : CLEAR);
        if (waited >= 20) {
            *stroke = *stroke == 65535 ? 1 : *stroke + 1;
            p[3] = *stroke;
            p[18] += n_taken + n_lost > 0;
            p[31] = *stroke;
            p[2] = ENABLE | CLEAR | TRIGGER | (n_taken + n_lost ? 0 : BASELINE);
            next = WAIT_ECHO;
        }
        break;
    case WAIT_ECHO:
        if (h[3] == *stroke && h[5] == p[4]) {
            p[2] = ENABLE | CLEAR;
            next = WAIT_RESULT;
        }
        break;
    case WAIT_RESULT:
        if (alive && h[0] == 1 && h[2] & VALID && h[4] == *stroke && h[5] == p[4] && h[8] == h[53]) {
            judge(h);
            memcpy(taken[n_taken++], h, sizeof taken[0]);
            p[2] = ENABLE | CLEAR | ACK;
            next = WAIT_CLEAR;
        }
        break;
    case WAIT_CLEAR:
        if (!(h[2] & VALID)) {
            p[2] = ENABLE | CLEAR;
            next = n_taken + n_lost <= strokes ? RAM : LEAVING;
        }
        break;
    case LEAVING:
        p[2] = ENABLE | CLEAR | PART_END;
        if (waited >= 600) next = DONE;
        break;
    case DONE:
        break;
    }
    if (next == state && state != LEAVING && state != DONE && waited > limit_ms) {
        static const char *const waits[] = {"no ready", "no ram", "no echo", "no result", "valid stays up"};
        wrong(*stroke, waits[state]);
        n_lost++;
        next = DONE;
    }
    if (next != state) *since = now;
    return next;
}

static void print_summary(bool passed) {
    printf("{\"peer\": \"libmodbus\", \"strokes\": %u, \"writes\": %d, \"writes_outside\": %d, \"writes_before_sync\": %d, "
           "\"duplicates\": %d, \"missed_reported\": %u, \"wrong\": %d, \"passed\": %s, \"results\": [",
           words[P + 18], n_writes, n_outside, n_before_sync, n_duplicates, words[H + 9], n_wrong,
           passed ? "true" : "false");
    for (int i = 0; i < n_taken; i++) {
        printf("%s{\"stroke\": %u, \"words\": [", i ? ", " : "", taken[i][4]);
        for (int j = 0; j < 64; j++) printf("%s%u", j ? ", " : "", taken[i][j]);
        printf("]}");
    }
    printf("]}\n");
}

/* Serves what has arrived on `fd`; false when the client has left. */
static bool serve(modbus_t *ctx, modbus_mapping_t *mapping, int fd) {
    uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
    modbus_set_socket(ctx, fd);
    const int length = modbus_receive(ctx, query);
    if (length < 0) return false;
    if (length == 0) return true; /* for another unit */
    look_at_request(query + modbus_get_header_length(ctx));
    if (modbus_reply(ctx, query, length, mapping) < 0) return false;
    look_at_host();
    return true;
}

int main(int argc, char **argv) {
    int strokes = 20, limit_s = 30, port = 0, option;
    uint16_t stroke = 0;
    const char *device = NULL;
    while ((option = getopt(argc, argv, "n:l:p:f:s:")) != -1) {
        switch (option) {
        case 'n': strokes = atoi(optarg); break;
        case 'l': limit_s = atoi(optarg); break;
        case 'p': port = atoi(optarg); break;
        case 'f': stroke = (uint16_t)(atoi(optarg) - 1); break;
        case 's': device = optarg; break;
        default:
            fprintf(stderr, "usage: %s [-n STROKES] [-l LIMIT_S] [-f FIRST] [-p PORT | -s DEVICE]\n", argv[0]);
            return 2;
        }
    }
    if (strokes < 1 || strokes > 1000) return fprintf(stderr, "-n takes 1 to 1000\n"), 2;

    modbus_t *ctx = device ? modbus_new_rtu(device, 115200, 'E', 8, 1) : modbus_new_tcp("127.0.0.1", port);
    modbus_mapping_t *mapping = modbus_mapping_new(0, 0, SIZE, 0);
    if (!ctx || !mapping) return perror("libmodbus"), 2;
    modbus_set_slave(ctx, UNIT);
    words = mapping->tab_registers;
    words[P] = 1;
    words[P + 2] = ENABLE | CLEAR;
    words[P + 3] = words[P + 31] = stroke;
    words[P + 4] = (uint16_t)(1 + now_ms() % 65535);
    words[P + 5] = RECIPE;
    words[P + 6] = 2;
    words[P + 7] = PRESS_ID;
    words[P + 9] = 1;
    words[P + 19] = 3500;

    int listener = -1, client = -1;
    if (device) {
        if (modbus_connect(ctx) < 0) return perror(device), 2;
        client = modbus_get_socket(ctx);
    } else {
        listener = modbus_tcp_listen(ctx, 1);
        struct sockaddr_in address;
        socklen_t size = sizeof address;
        if (listener < 0 || getsockname(listener, (struct sockaddr *)&address, &size) < 0) return perror("listen"), 2;
        port = ntohs(address.sin_port);
    }
    printf("{\"port\": %d}\n", port);
    fflush(stdout);

    int64_t since = now_ms();
    for (enum state state = WAIT_READY; state != DONE;) {
        fd_set ready;
        struct timeval wait = {.tv_sec = 0, .tv_usec = 2000};
        FD_ZERO(&ready);
        if (listener >= 0) FD_SET(listener, &ready);
        if (client >= 0) FD_SET(client, &ready);
        const int highest = listener > client ? listener : client;
        if (select(highest + 1, &ready, NULL, NULL, &wait) < 0 && errno != EINTR) return perror("select"), 2;
        if (listener >= 0 && FD_ISSET(listener, &ready)) {
            if (client >= 0) close(client);
            client = modbus_tcp_accept(ctx, &listener);
            read_p = read_h = false;
        } else if (client >= 0 && FD_ISSET(client, &ready) && !serve(ctx, mapping, client) && !device) {
            close(client);
            client = -1;
        }
        state = cycle(state, strokes, &since, &stroke, (int64_t)limit_s * 1000);
    }
    const bool passed = n_taken == strokes + 1 && !n_wrong && !n_outside && !n_before_sync && !n_duplicates && !words[H + 9];
    print_summary(passed);
    if (client >= 0 && !device) close(client);
    if (listener >= 0) close(listener);
    modbus_mapping_free(mapping);
    modbus_free(ctx);
    return passed ? 0 : 1;
}
