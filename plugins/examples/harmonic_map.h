/* harmonic_map.h - the harmonic map of a mesh onto the plate, its boundary held at the mesh's `places`: minimum of the sum of
 * (cot a + cot b) |p_i - p_j|^2 over the edges (Pinkall, Polthier 1993), by conjugate gradients. C11 and C++17.
 *
 * Uniform weights instead of cotangents give Tutte's map, which preserves no lengths: the host refuses it. */
#ifndef HARMONIC_MAP_H
#define HARMONIC_MAP_H

#include "platen.h"

#include <math.h>
#include <stdlib.h>

/* Returns L x on the interior: the sum over the edges at a vertex of weight (x_i - x_j). */
static inline void harmonic_apply(uint64_t n, const uint32_t *triangles, uint64_t n_triangles, const double *cot, const char *held,
                                  const double *x, double *out) {
  for (uint64_t k = 0; k < n; k++) out[k] = 0;
  for (uint64_t t = 0; t < n_triangles; t++)
    for (int c = 0; c < 3; c++) {
      uint32_t i = triangles[3 * t + (c + 1) % 3], j = triangles[3 * t + (c + 2) % 3];
      double flow = cot[3 * t + c] * (x[i] - x[j]);
      out[i] += flow, out[j] -= flow;
    }
  for (uint64_t k = 0; k < n; k++)
    if (held[k]) out[k] = 0;
}

/* Fills uv, 2 numbers a vertex. `stopped` is asked once a step. Returns 0, or 1 without memory, 2 when stopped, 3 when there is none. */
static inline int harmonic_map(const platen_mesh *mesh, double *uv, int (*stopped)(void *), void *asked) {
  const char *base = (const char *)mesh;
  uint64_t n = mesh->vertices.count / 3, n_triangles = mesh->triangles.count / 3;
  const double *points = (const double *)(base + mesh->vertices.offset), *places = (const double *)(base + mesh->places.offset);
  const uint32_t *triangles = (const uint32_t *)(base + mesh->triangles.offset);
  const uint32_t *boundary = (const uint32_t *)(base + mesh->boundary.offset);
  double *cot = (double *)malloc(3 * n_triangles * sizeof(double)), *work = (double *)malloc(4 * n * sizeof(double));
  char *held = (char *)calloc(n, 1);
  if (!cot || !work || !held) return free(cot), free(work), free(held), 1;
  for (uint64_t t = 0; t < n_triangles; t++)
    for (int c = 0; c < 3; c++) {
      const double *o = points + 3 * triangles[3 * t + c], *a = points + 3 * triangles[3 * t + (c + 1) % 3];
      const double *b = points + 3 * triangles[3 * t + (c + 2) % 3];
      double p[3] = {a[0] - o[0], a[1] - o[1], a[2] - o[2]}, q[3] = {b[0] - o[0], b[1] - o[1], b[2] - o[2]};
      double x = p[1] * q[2] - p[2] * q[1], y = p[2] * q[0] - p[0] * q[2], z = p[0] * q[1] - p[1] * q[0];
      cot[3 * t + c] = (p[0] * q[0] + p[1] * q[1] + p[2] * q[2]) / sqrt(x * x + y * y + z * z);
    }
  for (uint64_t k = 0; k < mesh->boundary.count; k++) held[boundary[k]] = 1;
  double *x = work, *r = work + n, *d = work + 2 * n, *ld = work + 3 * n;
  int result = 0;
  for (int axis = 0; axis < 2 && result == 0; axis++) {
    for (uint64_t k = 0; k < n; k++) x[k] = 0.5 * (axis == 0 ? mesh->width : mesh->height);
    for (uint64_t k = 0; k < mesh->boundary.count; k++) x[boundary[k]] = places[2 * k + axis];
    harmonic_apply(n, triangles, n_triangles, cot, held, x, ld);
    double rr = 0;
    for (uint64_t k = 0; k < n; k++) r[k] = d[k] = -ld[k], rr += r[k] * r[k];
    /* In exact arithmetic n steps are enough. */
    uint64_t steps = 0;
    for (double first = rr; rr > 1e-26 * first && result == 0; steps++) {
      if (stopped(asked)) result = 2;
      harmonic_apply(n, triangles, n_triangles, cot, held, d, ld);
      double dld = 0, next = 0;
      for (uint64_t k = 0; k < n; k++) dld += d[k] * ld[k];
      if (!(dld > 0) || steps > n) {
        result = 3;
        break;
      }
      for (uint64_t k = 0; k < n; k++) x[k] += rr / dld * d[k], r[k] -= rr / dld * ld[k], next += r[k] * r[k];
      for (uint64_t k = 0; k < n; k++) d[k] = r[k] + next / rr * d[k];
      rr = next;
    }
    for (uint64_t k = 0; k < n; k++) uv[2 * k + axis] = x[k];
  }
  return free(cot), free(work), free(held), result;
}

#endif
