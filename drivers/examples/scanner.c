/* Example of a scanner driver: a level floor, `height` metres below the scanner.
 *
 * cc -std=c11 -O2 -shared -fPIC -fvisibility=hidden -I. -o libmy_plugin.so scanner.c -lm */
#include "platen.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ROWS 60
#define COLUMNS 80
#define STEP 0.01

static const platen_host *host;
static const platen_option options[] = {{sizeof(platen_option), PLATEN_TYPE_FLOAT, PLATEN_OPTION_HAS_MIN, 0, "height", "m",
                                         "Height of the scanner over the floor.", "2.0", 0.1, 0.0, NULL}};
static const char *const outputs[] = {PLATEN_FORMAT_SCAN, PLATEN_FORMAT_COLUMN, PLATEN_FORMAT_SCAN_END, NULL};
static const platen_desc description = {sizeof(platen_desc), 0, "my-plugin", "scanner", "Plane scanner", "an integrator",
                                        "1.0.0", "Sees a level floor.", NULL, "MIT", NULL, outputs, options, 1, 0};

static platen_status emit(const platen_job *job, const char *format, platen_buffer buffer) {
  platen_frame frame = {sizeof frame, 0, format, NULL, buffer};
  return host->emit(host, job->job_id, &frame);
}

static platen_status put(const platen_job *job, const char *format, const void *head, uint64_t size) {
  platen_buffer buffer;
  platen_status status = host->buffer_alloc(host, job->job_id, size, &buffer);
  if (status != PLATEN_OK) return status;
  memcpy(buffer.data, head, size);
  return emit(job, format, buffer);
}

static platen_status column(const platen_job *job, uint32_t index, double height) {
  enum { HEAD = (sizeof(platen_column) + 7) / 8 * 8 };
  platen_buffer buffer;
  uint64_t at = HEAD;
  platen_column head = {sizeof head, index, 0, 0, {0, ROWS}, {0, ROWS}, {0, ROWS}, {0, ROWS}, {0, ROWS}};
  head.azimuth.offset = at, at += ROWS * sizeof(double);
  head.elevation.offset = at, at += ROWS * sizeof(double);
  head.range_m.offset = at, at += ROWS * sizeof(double);
  head.intensity.offset = at, at += ROWS * sizeof(uint16_t);
  head.state.offset = at, at += ROWS;
  platen_status status = host->buffer_alloc(host, job->job_id, at, &buffer);
  if (status != PLATEN_OK) return status;
  char *base = buffer.data;
  memcpy(base, &head, sizeof head);
  for (int row = 0; row < ROWS; row++) {
    double elevation = -0.3 - STEP * row;
    ((double *)(base + head.azimuth.offset))[row] = STEP * index;
    ((double *)(base + head.elevation.offset))[row] = elevation;
    ((double *)(base + head.range_m.offset))[row] = height / -sin(elevation);
    ((uint16_t *)(base + head.intensity.offset))[row] = 1000;
    base[head.state.offset + row] = 0;
  }
  return emit(job, PLATEN_FORMAT_COLUMN, buffer);
}

static platen_status run(platen_instance *self, const platen_job *job, const platen_frame *in, uint32_t n_in,
                         platen_error *error) {
  (void)in, (void)n_in, (void)error;
  platen_scan scan = {sizeof scan, 0, ROWS, COLUMNS, 0.0, STEP, -0.3, STEP, UINT32_MAX, 0, 2047, 0.0, {0, 0}, {0, 0}, 0.0};
  platen_status status = put(job, PLATEN_FORMAT_SCAN, &scan, sizeof scan);
  for (uint32_t index = 0; status == PLATEN_OK && index < COLUMNS; index++) {
    if (host->cancelled(host, job->job_id)) return PLATEN_E_CANCELLED;
    status = column(job, index, *(double *)self->data);
  }
  platen_scan_end end = {sizeof end, COLUMNS, ROWS * COLUMNS, 0, 0};
  return status != PLATEN_OK ? status : put(job, PLATEN_FORMAT_SCAN_END, &end, sizeof end);
}

static platen_status open_(platen_instance *self, platen_error *error) { return (void)self, (void)error, PLATEN_OK; }
static void close_(platen_instance *self) { (void)self; }
static void destroy(platen_instance *self) { free(self->data), free(self); }

static platen_status init(const platen_host *given, const char *dir, platen_error *error) {
  (void)dir, (void)error;
  host = given;
  host->log(host, 0, 3, "plane scanner in C");
  return PLATEN_OK;
}
static uint32_t count(void) { return 1; }
static const platen_desc *desc(uint32_t index) { return index == 0 ? &description : NULL; }
static platen_status create(const platen_host *given, const char *id, const platen_value *values, uint32_t n,
                            platen_instance **out, platen_error *error) {
  (void)given, (void)id;
  if (n != 1 || values[0].f > 100.0) {
    strcpy(error->message, "height is above any hall");
    strcpy(error->hint, "give metres");
    return PLATEN_E_CONFIG;
  }
  platen_instance *self = malloc(sizeof *self);
  *self = (platen_instance){sizeof *self, 0, malloc(sizeof(double)), open_, run, NULL, close_, destroy, NULL};
  *(double *)self->data = values[0].f;
  *out = self;
  return PLATEN_OK;
}

PLATEN_EXPORT const platen_entry platen_entry_2 = {sizeof(platen_entry), PLATEN_ABI_MINOR, init, NULL, count, desc, create};
