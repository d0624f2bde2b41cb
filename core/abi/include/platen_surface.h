/* platen_surface.h - evaluates S(u, v), the mid-surface that a comparison receives (platen.surface/1): point and derivatives, normal,
 * curvature, standard deviation. Header-only; C11 and C++17. Metres, 1/m; u and v within the plate are the caller's care: places
 * beyond it are taken at its edge.
 *
 * S is a bicubic B-spline over uniform knots (de Boor, A Practical Guide to Splines, 1978). */
#ifndef PLATEN_SURFACE_H
#define PLATEN_SURFACE_H

#include "platen.h"

#include <math.h>
#include <string.h>

typedef struct platen_plate {
  double width, height, thickness;
  uint32_t n_u, n_v; /* control points along u and v */
  uint32_t mask_u, mask_v;
  const double *control, *covariance;
  const uint8_t *seen;
} platen_plate;

/* A place on the plate: position and derivatives of S. */
typedef struct platen_jet {
  double p[3], u[3], v[3], uu[3], uv[3], vv[3];
} platen_jet;

/* Second fundamental form in the orthonormal frame of S_u and its normal in the surface. */
typedef struct platen_curvature {
  double u, v, uv;
} platen_curvature;

/* Reads a surface among the inputs of a job: role now, before or baseline. Returns 0 where it is not there. */
static inline int platen_plate_of(const platen_frame *in, uint32_t n_in, const char *role, platen_plate *out) {
  for (uint32_t k = 0; k < n_in; k++) {
    if (strcmp(in[k].format, PLATEN_FORMAT_SURFACE) != 0 || !in[k].role || strcmp(in[k].role, role) != 0) continue;
    const char *base = (const char *)in[k].buffer.data;
    const platen_surface *head = (const platen_surface *)in[k].buffer.data;
    const double *knots_u = (const double *)(base + head->knots_u.offset), *knots_v = (const double *)(base + head->knots_v.offset);
    out->n_u = (uint32_t)head->knots_u.count - 4, out->n_v = (uint32_t)head->knots_v.count - 4;
    out->width = knots_u[out->n_u] - knots_u[3], out->height = knots_v[out->n_v] - knots_v[3];
    out->thickness = head->thickness, out->mask_u = head->mask_u, out->mask_v = head->mask_v;
    out->control = (const double *)(base + head->control.offset);
    out->covariance = (const double *)(base + head->covariance.offset);
    out->seen = (const uint8_t *)(base + head->seen.offset);
    return 1;
  }
  return 0;
}

/* The four cubic B-splines over x, of n control points, their first and second derivatives. Returns the first one's number. */
static inline uint32_t platen_basis(double x, double length, uint32_t n, double b[4], double d1[4], double d2[4]) {
  double step = length / (n - 3), at = x / step;
  if (!(at > 0)) at = 0;
  if (at > n - 3) at = n - 3;
  uint32_t first = (uint32_t)at < n - 4 ? (uint32_t)at : n - 4;
  double t = at - first, s = 1 - t;
  b[0] = s * s * s / 6, b[1] = (4 - 6 * t * t + 3 * t * t * t) / 6, b[2] = (4 - 6 * s * s + 3 * s * s * s) / 6, b[3] = t * t * t / 6;
  d1[0] = -s * s / (2 * step), d1[1] = (3 * t * t - 4 * t) / (2 * step), d1[2] = (4 * s - 3 * s * s) / (2 * step), d1[3] = t * t / (2 * step);
  d2[0] = s / (step * step), d2[1] = (3 * t - 2) / (step * step), d2[2] = (3 * s - 2) / (step * step), d2[3] = t / (step * step);
  return first;
}

static inline platen_jet platen_jet_at(const platen_plate *plate, double u, double v) {
  double bu[3][4], bv[3][4];
  uint32_t i = platen_basis(u, plate->width, plate->n_u, bu[0], bu[1], bu[2]);
  uint32_t k = platen_basis(v, plate->height, plate->n_v, bv[0], bv[1], bv[2]);
  platen_jet jet;
  double *out[6] = {jet.p, jet.u, jet.v, jet.uu, jet.uv, jet.vv};
  const int order[6][2] = {{0, 0}, {1, 0}, {0, 1}, {2, 0}, {1, 1}, {0, 2}};
  for (int part = 0; part < 6; part++) {
    out[part][0] = out[part][1] = out[part][2] = 0;
    for (int row = 0; row < 4; row++)
      for (int column = 0; column < 4; column++) {
        const double *point = plate->control + 3 * ((k + row) * (uint64_t)plate->n_u + i + column);
        double weight = bu[order[part][0]][column] * bv[order[part][1]][row];
        for (int axis = 0; axis < 3; axis++) out[part][axis] += weight * point[axis];
      }
  }
  return jet;
}

static inline double platen_dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Unit normal, towards the scanner. */
static inline void platen_normal(const platen_jet *jet, double normal[3]) {
  const double *a = jet->u, *b = jet->v;
  normal[0] = a[1] * b[2] - a[2] * b[1], normal[1] = a[2] * b[0] - a[0] * b[2], normal[2] = a[0] * b[1] - a[1] * b[0];
  double length = sqrt(platen_dot(normal, normal));
  for (int axis = 0; axis < 3; axis++) normal[axis] /= length;
}

static inline platen_curvature platen_curvature_of(const platen_jet *jet) {
  double normal[3];
  platen_normal(jet, normal);
  double e = platen_dot(jet->u, jet->u), f = platen_dot(jet->u, jet->v), g = platen_dot(jet->v, jet->v), area2 = e * g - f * f;
  double l = platen_dot(jet->uu, normal), m = platen_dot(jet->uv, normal), n = platen_dot(jet->vv, normal);
  platen_curvature out;
  out.u = l / e, out.uv = (m - f * out.u) / sqrt(area2), out.v = (n * e - 2 * f * m + f * f * out.u) / area2;
  return out;
}

/* Whether the plate was seen there. */
static inline int platen_seen(const platen_plate *plate, double u, double v) {
  int64_t i = (int64_t)(u / plate->width * plate->mask_u), k = (int64_t)(v / plate->height * plate->mask_v);
  i = i < 0 ? 0 : i >= plate->mask_u ? plate->mask_u - 1 : i, k = k < 0 ? 0 : k >= plate->mask_v ? plate->mask_v - 1 : k;
  return plate->seen[k * plate->mask_u + i] != 0;
}

/* Standard deviation of the position along the normal, metres. */
static inline double platen_sigma(const platen_plate *plate, double u, double v) {
  double bu[3][4], bv[3][4], sum = 0;
  uint32_t first_u = platen_basis(u, plate->width, plate->n_u, bu[0], bu[1], bu[2]);
  uint32_t first_v = platen_basis(v, plate->height, plate->n_v, bv[0], bv[1], bv[2]);
  for (int a = 0; a < 16; a++) {
    int i = a % 4, k = a / 4;
    const double *row = plate->covariance + 49 * ((first_v + k) * (uint64_t)plate->n_u + first_u + i);
    double inner = 0;
    for (int b = 0; b < 16; b++) inner += bu[0][b % 4] * bv[0][b / 4] * row[(b / 4 + 3 - k) * 7 + b % 4 + 3 - i];
    sum += bu[0][i] * bv[0][k] * inner;
  }
  return sum > 0 ? sqrt(sum) : 0;
}

#endif
