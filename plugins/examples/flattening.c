/* Example of a flattening: the harmonic map, which is correct on plates that were bent without stretching.
 *
 * cc -std=c11 -O2 -shared -fPIC -fvisibility=hidden -I. -o libmy_plugin.so flattening.c -lm */
#include "harmonic_map.h"

#include <stdio.h>
#include <string.h>

static const platen_host *host;
static const char *const inputs[] = {PLATEN_FORMAT_MESH, NULL};
static const char *const outputs[] = {PLATEN_FORMAT_CHART, NULL};
static const platen_desc about = {sizeof(platen_desc), 0, "my-plugin", "flattening", "Harmonic map", "an integrator", "0.1.0",
                                  "Harmonic map, solved by conjugate gradients.", NULL, "MIT", inputs, outputs, NULL, 0, 0};

static int stopped(void *job) { return host->cancelled(host, ((const platen_job *)job)->job_id); }

static platen_status run(platen_instance *self, const platen_job *job, const platen_frame *in, uint32_t n_in, platen_error *error) {
  (void)self;
  if (n_in != 1 || strcmp(in[0].format, PLATEN_FORMAT_MESH) != 0) {
    snprintf(error->message, sizeof error->message, "no mesh came");
    return PLATEN_E_NO_DATA;
  }
  const platen_mesh *mesh = in[0].buffer.data;
  uint64_t n = mesh->vertices.count / 3;
  platen_chart head = {sizeof head, 0, {sizeof head, 2 * n}, {0, 0}};
  platen_frame frame = {sizeof frame, 0, PLATEN_FORMAT_CHART, NULL, {NULL, 0, 0}};
  platen_status status = host->buffer_alloc(host, job->job_id, sizeof head + 2 * n * sizeof(double), &frame.buffer);
  if (status != PLATEN_OK) return status;
  memcpy(frame.buffer.data, &head, sizeof head);
  int failed = harmonic_map(mesh, (double *)((char *)frame.buffer.data + sizeof head), stopped, (void *)job);
  if (!failed) return host->emit(host, job->job_id, &frame);
  host->buffer_free(host, &frame.buffer);
  if (failed == 1) return PLATEN_E_MEMORY;
  if (failed == 2) return PLATEN_E_CANCELLED;
  snprintf(error->message, sizeof error->message, "the mesh has no harmonic map");
  snprintf(error->hint, sizeof error->hint, "scan again with the whole plate in view");
  return PLATEN_E_BAD_DATA;
}

static platen_status open_(platen_instance *self, platen_error *error) { return (void)self, (void)error, PLATEN_OK; }
static void close_(platen_instance *self) { (void)self; }
static void destroy(platen_instance *self) { free(self); }

static platen_status init(const platen_host *given, const char *folder, platen_error *error) {
  return (void)folder, (void)error, host = given, PLATEN_OK;
}
static uint32_t count(void) { return 1; }
static const platen_desc *desc(uint32_t index) { return index == 0 ? &about : NULL; }
static platen_status create(const platen_host *given, const char *id, const platen_value *values, uint32_t n, platen_instance **out,
                            platen_error *error) {
  (void)given, (void)id, (void)values, (void)n, (void)error;
  platen_instance *self = malloc(sizeof *self);
  if (!self) return PLATEN_E_MEMORY;
  *self = (platen_instance){sizeof *self, 0, NULL, open_, run, NULL, close_, destroy, NULL};
  return *out = self, PLATEN_OK;
}

PLATEN_EXPORT const platen_entry platen_entry_2 = {sizeof(platen_entry), PLATEN_ABI_MINOR, init, NULL, count, desc, create};
