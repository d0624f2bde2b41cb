/* A plugin that works as another one, but for one fault: loads TARGET and hands all calls on, and does FAULT at jobs of stroke STROKE
 * (0: of every stroke), in the call WHERE. Compiled with -DTARGET='"..."' -DWHERE=run -DFAULT=... -DSTROKE=3.
 *
 * WHERE=word FAULT=none SPOIL=...: what it emits is spoiled, as a plugin that is wrong would say it. */
#define _GNU_SOURCE
#include "platen.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#ifndef STROKE
#define STROKE 0
#endif

enum { run = 1, create, open_, close_, cancel, init, constructor, word };

static void nap(void) {
  struct timespec second = {1, 0};
  nanosleep(&second, NULL);
}
static void segv(void) { *(volatile int *)8 = 1; }
static void leave(void) { exit(0); }
static void leave_3(void) { _exit(3); }
static void give_up(void) { abort(); }
static void overflow(void) {
  volatile char deep[1 << 16];
  deep[0] = 1;
  overflow();
  deep[1] = 1;
}
static void spin(void) {
  for (volatile int k = 0;; k++) {
  }
}
static void hang(void) {
  for (;;) nap();
}
static void ignore_term(void) { signal(SIGTERM, SIG_IGN), signal(SIGINT, SIG_IGN); }
static void close_all(void) {
  for (int fd = 0; fd < 64; fd++) close(fd);
}
static void print(void) { printf("a line for whoever reads the host's output\n"), fflush(stdout); }
static void open_file(void) { (void)!open("/etc/hostname", O_RDONLY); }
static void open_socket(void) { (void)!socket(AF_INET, SOCK_STREAM, 0); }
static void shell(void) { (void)!system("true"); }
static void fork_away(void) {
  if (fork() == 0) hang();
}
static void eat_memory(void) {
  // A limit of the address space ends it at once; without one it has asked for 256 GiB, touched 1, and hangs.
  for (int n = 0; n < 4096; n++) {
    char *more = malloc(64 << 20);
    if (!more) abort();
    memset(more, 1, 256 << 10);
  }
  hang();
}
static void eat_files(void) {
  for (int n = 0; n < 300; n++)
    if (dup(2) < 0) abort();
}
static void shrink_pool(void) {
  for (int fd = 3; fd < 64; fd++) (void)!ftruncate(fd, 0);
}
static void none(void) {}
static void leak(void) {
  static char *volatile lost;
  if ((lost = malloc(4 << 20))) memset(lost, 1, 4 << 20);
}
static void *idle(void *none) {
  for (;;) nap();
  return none;
}
static void start_thread(void) {
  pthread_t thread;
  pthread_create(&thread, NULL, idle, NULL);
}
static void doze(void) {
  struct timespec doze = {0, 700000000};
  nanosleep(&doze, NULL);
}
/* In every other job, at any moment within 100 ms. */
static void *die_later(void *when) {
  nanosleep(when, NULL);
  __builtin_trap();
}
static void maybe_die(void) {
  static struct timespec when;
  pthread_t thread;
  clock_gettime(CLOCK_MONOTONIC, &when);
  unsigned long random = (unsigned long)when.tv_nsec / 1000 * 2654435761u >> 7;
  when = (struct timespec){0, (long)(random % 100) * 1000000};
  if (random / 100 % 2 == 0) pthread_create(&thread, NULL, die_later, &when);
}

#ifndef SPOIL
#define SPOIL as_it_is
#endif
#define AT(type, frame, member) ((type *)((char *)(frame)->buffer.data + (member).offset))

static const platen_host *host;
static uint64_t job_of_frame;
static int is(const platen_frame *frame, const char *format) { return strcmp(frame->format, format) == 0; }
static platen_column *column_of(const platen_frame *frame) {
  return is(frame, PLATEN_FORMAT_COLUMN) ? frame->buffer.data : NULL;
}
static void as_it_is(platen_frame *frame) { (void)frame; }
static void face_9(platen_frame *frame) {
  if (column_of(frame)) column_of(frame)->face = 9;
}
static void state_9(platen_frame *frame) {
  platen_column *column = column_of(frame);
  if (column) *AT(uint8_t, frame, column->state) = 9;
}
static void azimuth_100(platen_frame *frame) {
  platen_column *column = column_of(frame);
  if (column) *AT(double, frame, column->azimuth) = 100;
}
static void range_nan(platen_frame *frame) {
  platen_column *column = column_of(frame);
  if (!column) return;
  *AT(double, frame, column->range_m) = NAN;
  *AT(uint8_t, frame, column->state) = 0;
}
static void same_index(platen_frame *frame) {
  if (column_of(frame)) column_of(frame)->index = 5;
}
static void intensity_beyond(platen_frame *frame) {
  if (is(frame, PLATEN_FORMAT_SCAN)) ((platen_scan *)frame->buffer.data)->intensity_max = 1;
}
static void intensity_turned(platen_frame *frame) {
  if (is(frame, PLATEN_FORMAT_SCAN)) ((platen_scan *)frame->buffer.data)->intensity_min = 65535;
}
static void rows_4e9(platen_frame *frame) {
  if (is(frame, PLATEN_FORMAT_SCAN)) ((platen_scan *)frame->buffer.data)->n_rows = 4000000000u;
}
static void end_of_7_columns(platen_frame *frame) {
  if (is(frame, PLATEN_FORMAT_SCAN_END)) ((platen_scan_end *)frame->buffer.data)->columns = 7;
}
static void end_of_7_points(platen_frame *frame) {
  if (is(frame, PLATEN_FORMAT_SCAN_END)) ((platen_scan_end *)frame->buffer.data)->points = 7;
}
static void outcome_9(platen_frame *frame) {
  if (is(frame, PLATEN_FORMAT_SCAN_END)) ((platen_scan_end *)frame->buffer.data)->outcome = 9;
}
static void span_beyond(platen_frame *frame) {
  if (column_of(frame)) column_of(frame)->range_m.count = (uint64_t)1 << 63;
}

/* A chart, to be spoiled by vertex. */
static void chart(platen_frame *frame, void (*spoil)(double *uv, double *sigma, uint64_t vertex)) {
  if (!is(frame, PLATEN_FORMAT_CHART)) return;
  platen_chart *head = frame->buffer.data;
  double *uv = AT(double, frame, head->uv), *sigma = head->sigma.count ? AT(double, frame, head->sigma) : NULL;
  for (uint64_t k = 0; k < head->uv.count / 2; k++) spoil(uv + 2 * k, sigma ? sigma + 2 * k : NULL, k);
}
static void bump(double *uv, double *sigma, uint64_t k) {
  (void)sigma, (void)k;
  uv[0] += 0.03 * sin(M_PI * fmin(fmax(uv[0] / 2.0, 0), 1)) * sin(M_PI * fmin(fmax(uv[1] / 2.5, 0), 1));
}
static void wide(double *uv, double *sigma, uint64_t k) { (void)sigma, (void)k, uv[0] *= 1.01; }
static void nan_sigma(double *uv, double *sigma, uint64_t k) {
  (void)uv;
  if (k == 9 && sigma) sigma[1] = NAN;
}
static void minus_sigma(double *uv, double *sigma, uint64_t k) {
  (void)uv;
  if (k == 9 && sigma) sigma[1] = -1;
}
static void little(double *uv, double *sigma, uint64_t k) {
  (void)sigma, (void)k;
  uv[0] += 1e-4 * sin(M_PI * fmin(fmax(uv[0] / 3.0, 0), 1)) * sin(M_PI * fmin(fmax(uv[1] / 2.0, 0), 1));
}
/* Another answer from each process, and from each job. */
static void process_noise(double *uv, double *sigma, uint64_t k) {
  (void)sigma;
  if (k == 1700) uv[0] += 1e-12 * getpid();
}
static void job_noise(double *uv, double *sigma, uint64_t k) {
  static int jobs;
  (void)sigma;
  if (k == 1700) uv[0] += 1e-10 * jobs++;
}
static void chart_off(platen_frame *frame) { chart(frame, little); }
static void chart_of_process(platen_frame *frame) { chart(frame, process_noise); }
static void chart_of_job(platen_frame *frame) { chart(frame, job_noise); }
static void chart_moved(platen_frame *frame) { chart(frame, bump); }
static void chart_wide(platen_frame *frame) { chart(frame, wide); }
static void sigma_nan(platen_frame *frame) { chart(frame, nan_sigma); }
static void sigma_minus(platen_frame *frame) { chart(frame, minus_sigma); }

/* Findings of one's own instead. */
static void findings(platen_frame *frame, const char *json) {
  if (!is(frame, PLATEN_FORMAT_FINDINGS)) return;
  host->buffer_free(host, &frame->buffer);
  if (host->buffer_alloc(host, job_of_frame, strlen(json), &frame->buffer) == PLATEN_OK) memcpy(frame->buffer.data, json, strlen(json));
}
#define FINDINGS(name, json) \
  static void name(platen_frame *frame) { findings(frame, json); }
FINDINGS(figure_null, "{\"figures\":[{\"name\":\"a\",\"value\":null,\"unit\":\"m\"}]}")
FINDINGS(figure_twice, "{\"figures\":[{\"name\":\"a\",\"value\":1,\"unit\":\"m\"},{\"name\":\"a\",\"value\":2,\"unit\":\"m\"}]}")
FINDINGS(figure_nameless, "{\"figures\":[{\"name\":\"\",\"value\":1,\"unit\":\"m\"}]}")
FINDINGS(figure_unsure, "{\"figures\":[{\"name\":\"a\",\"value\":1,\"unit\":\"m\",\"uncertainty\":-1}]}")
FINDINGS(figure_furlong, "{\"figures\":[{\"name\":\"a\",\"value\":1.5,\"unit\":\"furlong\"}]}")
FINDINGS(says_escape, "{\"says\":[\"\\u001b[31mred\\u0007\"]}")
FINDINGS(gap_0, "{\"verdict\":\"pass\",\"figures\":[{\"name\":\"gap.max\",\"value\":0,\"unit\":\"m\"}]}")

static platen_host spoiled;
static platen_status on_emit(const platen_host *self, uint64_t job, const platen_frame *frame) {
  platen_frame spoilt = *frame;
  (void)self, job_of_frame = job, SPOIL(&spoilt);
  return host->emit(host, job, &spoilt);
}
static const platen_host *spoil(const platen_host *real) {
  host = real, spoiled = *real, spoiled.emit = on_emit;
  return WHERE == word ? &spoiled : real;
}

static const platen_entry *target;
static void fault(int where, uint64_t stroke) {
  if (where == WHERE && (STROKE == 0 || stroke == STROKE)) FAULT();
}

__attribute__((constructor)) static void load(void) {
  void *handle = dlopen(TARGET, RTLD_NOW | RTLD_LOCAL);
  if (handle) target = dlsym(handle, "platen_entry_2");
  if (WHERE == constructor) FAULT();
}

typedef struct proxy {
  platen_instance raw;
  platen_instance *real;
} proxy;

static platen_status on_open(platen_instance *self, platen_error *error) {
  fault(open_, 0);
  return ((proxy *)self)->real->open(((proxy *)self)->real, error);
}
static platen_status on_run(platen_instance *self, const platen_job *job, const platen_frame *in, uint32_t n, platen_error *error) {
#ifdef WRITE_INPUT
  if (n > 0) *(volatile char *)in[n - 1].buffer.data = 1;
#endif
  fault(run, job->stroke_no);
  return ((proxy *)self)->real->run(((proxy *)self)->real, job, in, n, error);
}
static void on_cancel(platen_instance *self, uint64_t job) {
  fault(cancel, 0);
  if (((proxy *)self)->real->cancel) ((proxy *)self)->real->cancel(((proxy *)self)->real, job);
}
static void on_close(platen_instance *self) {
  fault(close_, 0);
  ((proxy *)self)->real->close(((proxy *)self)->real);
}
static void on_destroy(platen_instance *self) {
  ((proxy *)self)->real->destroy(((proxy *)self)->real);
  free(self);
}
static const void *on_extension(platen_instance *self, const char *id) {
  /* A table's functions take the real instance: only what needs no instance could be handed on. */
  return (void)self, (void)id, NULL;
}

static platen_status on_init(const platen_host *host, const char *folder, platen_error *error) {
  fault(init, 0);
  return target->init(spoil(host), folder, error);
}
/* Descriptions, spoiled. */
#ifndef SPOIL_DESC
#define SPOIL_DESC as_described
#endif
static void as_described(platen_desc *about) { (void)about; }
static void no_vendor(platen_desc *about) { about->vendor = ""; }
static void no_licence(platen_desc *about) { about->license = ""; }
static void no_purpose(platen_desc *about) { about->doc = " "; }
static void every_time_another(platen_desc *about) {
  static char version[20];
  snprintf(version, sizeof version, "1.0.%d", getpid());
  about->version = version;
}
static void option(platen_desc *about, int n, const char *name, const char *doc, const char *text) {
  static platen_option options[2];
  platen_option made = {sizeof made, PLATEN_TYPE_FLOAT, PLATEN_OPTION_HAS_MAX, 0, name, NULL, doc, text, 0, 5, NULL};
  options[n] = made, about->options = options, about->n_options = n + 1;
}
static void options_twice(platen_desc *about) { option(about, 0, "a", "An a.", "1"), option(about, 1, "a", "An a.", "1"); }
static void option_unexplained(platen_desc *about) { option(about, 0, "a", "", "1"); }
static void option_beyond(platen_desc *about) { option(about, 0, "a", "An a.", "7"); }
static void option_shouted(platen_desc *about) { option(about, 0, "LOUD", "A loud one.", "1"); }

static uint32_t count(void) { return target ? target->count() : 0; }
static const platen_desc *desc(uint32_t index) {
  static platen_desc about;
  if (!target || !target->desc(index)) return NULL;
  about = *target->desc(index), SPOIL_DESC(&about);
  return &about;
}
static platen_status on_create(const platen_host *host, const char *id, const platen_value *values, uint32_t n, platen_instance **out,
                               platen_error *error) {
  fault(create, 0);
  proxy *made = calloc(1, sizeof *made);
  platen_status status = target->create(spoil(host), id, values, n, &made->real, error);
  if (status != PLATEN_OK) return free(made), status;
  made->raw = (platen_instance){sizeof made->raw, 0, NULL, on_open, on_run, on_cancel, on_close, on_destroy, on_extension};
  *out = &made->raw;
  return PLATEN_OK;
}

PLATEN_EXPORT const platen_entry platen_entry_2 = {sizeof(platen_entry), PLATEN_ABI_MINOR, on_init, NULL, count, desc, on_create};
