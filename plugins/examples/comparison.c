/* Example of a comparison: the mean curvature of the plate along u, over the part that was seen.
 *
 * cc -std=c11 -O2 -shared -fPIC -fvisibility=hidden -I. -o libmy_plugin.so comparison.c -lm */
#include "platen_surface.h"

#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 101 };

static const platen_host *host;
static const platen_option options[] = {{sizeof(platen_option), PLATEN_TYPE_FLOAT, PLATEN_OPTION_HAS_MIN | PLATEN_OPTION_HAS_MAX, 0,
                                         "least_seen", NULL, "Least share of the plate that must have been seen.", "0.5", 0, 1, NULL}};
static const char *const inputs[] = {PLATEN_FORMAT_TASK, PLATEN_FORMAT_SURFACE, NULL};
static const char *const outputs[] = {PLATEN_FORMAT_FINDINGS, NULL};
static const platen_desc about = {sizeof(platen_desc), 0, "my-plugin", "comparison", "Mean curvature", "an integrator", "0.1.0",
                                  "Mean curvature along u.", NULL, "MIT", inputs, outputs, options, 1, 0};

static platen_status fail(platen_error *error, platen_status status, const char *message, const char *hint) {
  snprintf(error->message, sizeof error->message, "%s", message);
  snprintf(error->hint, sizeof error->hint, "%s", hint);
  return status;
}

static platen_status run(platen_instance *self, const platen_job *job, const platen_frame *in, uint32_t n_in, platen_error *error) {
  platen_plate plate;
  if (!platen_plate_of(in, n_in, "now", &plate)) return fail(error, PLATEN_E_NO_DATA, "no surface came", "report this to platen");
  double sum = 0;
  int seen = 0;
  for (int k = 0; k < SIDE; k++) {
    if (host->cancelled(host, job->job_id)) return PLATEN_E_CANCELLED;
    for (int i = 0; i < SIDE; i++) {
      double u = plate.width * i / (SIDE - 1), v = plate.height * k / (SIDE - 1);
      if (!platen_seen(&plate, u, v)) continue;
      platen_jet jet = platen_jet_at(&plate, u, v);
      sum += platen_curvature_of(&jet).u, seen++;
    }
  }
  if (seen < *(double *)self->data * SIDE * SIDE || seen == 0)
    return fail(error, PLATEN_E_BAD_DATA, "too little of the plate was seen", "scan again with the whole plate in view");
  char json[256];
  int n = snprintf(json, sizeof json, "{\"figures\":[{\"name\":\"mean_curvature.u\",\"value\":%.17g,\"unit\":\"1/m\"}]}", sum / seen);
  platen_frame frame = {sizeof frame, 0, PLATEN_FORMAT_FINDINGS, NULL, {NULL, 0, 0}};
  platen_status status = host->buffer_alloc(host, job->job_id, (uint64_t)n, &frame.buffer);
  if (status != PLATEN_OK) return status;
  memcpy(frame.buffer.data, json, (size_t)n);
  return host->emit(host, job->job_id, &frame);
}

static platen_status open_(platen_instance *self, platen_error *error) { return (void)self, (void)error, PLATEN_OK; }
static void close_(platen_instance *self) { (void)self; }
static void destroy(platen_instance *self) { free(self->data), free(self); }

static platen_status init(const platen_host *given, const char *folder, platen_error *error) {
  return (void)folder, (void)error, host = given, PLATEN_OK;
}
static uint32_t count(void) { return 1; }
static const platen_desc *desc(uint32_t index) { return index == 0 ? &about : NULL; }
static platen_status create(const platen_host *given, const char *id, const platen_value *values, uint32_t n, platen_instance **out,
                            platen_error *error) {
  (void)given, (void)id, (void)n;
  platen_instance *self = malloc(sizeof *self);
  double *least_seen = malloc(sizeof *least_seen);
  if (!self || !least_seen) return free(self), free(least_seen), fail(error, PLATEN_E_MEMORY, "no memory", "");
  *least_seen = values[0].f;
  *self = (platen_instance){sizeof *self, 0, least_seen, open_, run, NULL, close_, destroy, NULL};
  return *out = self, PLATEN_OK;
}

PLATEN_EXPORT const platen_entry platen_entry_2 = {sizeof(platen_entry), PLATEN_ABI_MINOR, init, NULL, count, desc, create};
