/* platen.h - C interface between platen and its plugins, major version 2.
 *
 * A plugin is a shared library that exports one constant:
 *
 *   PLATEN_EXPORT const platen_entry platen_entry_2 = {sizeof(platen_entry), PLATEN_ABI_MINOR, init, ...};
 *
 * Structs begin with struct_size and grow only at their end: a reader takes the members that both sides have, zero for the rest.
 *
 *   [inst]  calls of one instance: serialised, always the same thread
 *   [any]   any thread, may run at the same time as an [inst] call
 *
 * Each instance lives in a process of its own (`platen worker`). A plugin
 *   - lets no exception leave a call (C++: catch (...) in each), and does not write to inputs;
 *   - takes memory of frames from buffer_alloc, and emits or frees it before run returns;
 *   - returns from run by the deadline, and within 0.5 s after cancel: what is late is killed;
 *   - leaves alone what belongs to the process: signals, standard input and output, working folder, locale, rounding mode;
 *   - as a flattening or comparison reads its files in create: afterwards no file, socket or program can be opened.
 * PLATEN_OK from run means complete data. Metres, radians, UTF-8 with NUL, little endian.
 */
#ifndef PLATEN_H
#define PLATEN_H

#include <stdint.h>

#ifdef __cplusplus
#define PLATEN_EXPORT extern "C" __attribute__((visibility("default")))
extern "C" {
#else
#define PLATEN_EXPORT __attribute__((visibility("default")))
#endif

#define PLATEN_ABI_MINOR 0

/* After a failure the host reopens the instance (TIMEOUT, DISCONNECTED, IO) or gives the plugin a fresh process (MEMORY, STATE,
 * INTERNAL); it may repeat the job (TIMEOUT, DISCONNECTED, BUSY, or flag RETRYABLE). <= PLATEN_E_VENDOR: the plugin's, as IO. */
typedef int32_t platen_status;
enum {
  PLATEN_OK = 0,
  PLATEN_E_CANCELLED = -1,
  PLATEN_E_TIMEOUT = -2,
  PLATEN_E_CONFIG = -3,
  PLATEN_E_UNSUPPORTED = -4,
  PLATEN_E_NOT_FOUND = -5,
  PLATEN_E_DISCONNECTED = -6,
  PLATEN_E_BUSY = -7,
  PLATEN_E_DENIED = -8,
  PLATEN_E_IO = -9,
  PLATEN_E_NO_DATA = -10,
  PLATEN_E_BAD_DATA = -11,
  PLATEN_E_MEMORY = -12,
  PLATEN_E_STATE = -13,
  PLATEN_E_INTERNAL = -14,
  PLATEN_E_VENDOR = -10000
};

enum { PLATEN_ERROR_RETRYABLE = 1 };

/* Memory of the caller; the callee fills it when it fails. */
typedef struct platen_error {
  uint32_t struct_size, flags;
  int32_t vendor_code; /* of the device, shown behind the message; 0: none */
  uint32_t reserved;
  char message[512]; /* what happened, one sentence */
  char hint[256];    /* what to do, one sentence */
} platen_error;

/* One job, borrowed for the call. Times are of the host's monotonic clock (now_mono_ns) unless named utc. */
typedef struct platen_job {
  uint32_t struct_size, reserved;
  uint64_t job_id, stroke_no;
  int64_t trigger_mono_ns, trigger_utc_ns, deadline_mono_ns;
} platen_job;

typedef struct platen_buffer {
  void *data;
  uint64_t bytes, token;
} platen_buffer;

typedef struct platen_frame {
  uint32_t struct_size, reserved;
  const char *format;   /* "platen.column/2" */
  const char *role;     /* of an input where several have one format: now, before, baseline; else NULL */
  platen_buffer buffer; /* emit takes it */
} platen_frame;

enum {
  PLATEN_TYPE_BOOL = 1,       /* i */
  PLATEN_TYPE_INT = 2,        /* i */
  PLATEN_TYPE_FLOAT = 3,      /* f, in the declared unit */
  PLATEN_TYPE_STRING = 4,     /* s */
  PLATEN_TYPE_CHOICE = 5,     /* s */
  PLATEN_TYPE_PATH = 6,       /* s, absolute */
  PLATEN_TYPE_DURATION = 7,   /* f, seconds */
  PLATEN_TYPE_FLOAT_LIST = 8  /* list, n */
};
enum {
  PLATEN_OPTION_REQUIRED = 1,
  PLATEN_OPTION_SECRET = 2,
  PLATEN_OPTION_ADVANCED = 4,
  PLATEN_OPTION_DEPRECATED = 8,
  PLATEN_OPTION_HAS_MIN = 16,
  PLATEN_OPTION_HAS_MAX = 32
};

/* Declaration of one option; static data. struct_size is the stride of the array. */
typedef struct platen_option {
  uint32_t struct_size;
  int32_t type;
  uint32_t flags, reserved;
  const char *name, *unit, *doc, *default_text; /* default as TOML text, or NULL */
  double min, max;
  const char *const *choices; /* NULL at the end */
} platen_option;

/* Value of one option: checked, with its default applied, in the declared unit. */
typedef struct platen_value {
  const char *name;
  int32_t type, from_default;
  int64_t i;
  double f;
  const char *s;
  const double *list;
  uint64_t n;
} platen_value;

enum { PLATEN_DESC_HARDWARE = 1 };

/* Descriptor of a plugin: static data, available without I/O. */
typedef struct platen_desc {
  uint32_t struct_size, flags;
  const char *id, *kind, *name, *vendor, *version, *doc, *url, *license; /* kind: scanner, flattening, comparison, advisor */
  const char *const *inputs, *const *outputs;                            /* formats, NULL at the end; or NULL */
  const platen_option *options;
  uint32_t n_options, reserved;
} platen_desc;

/* Log levels: 1 error, 2 warn, 3 info, 4 debug, 5 trace. job_id 0: no job. */
typedef struct platen_host platen_host;
struct platen_host { /* all [any]; valid until deinit returns */
  uint32_t struct_size, abi_minor;
  const char *version; /* of the host, for logs */
  int (*log_enabled)(const platen_host *, int32_t level);
  void (*log)(const platen_host *, uint64_t job_id, int32_t level, const char *message);
  void (*progress)(const platen_host *, uint64_t job_id, double fraction, const char *phase);
  int (*cancelled)(const platen_host *, uint64_t job_id);
  /* Aligned to 8 bytes, contents undefined. Waits until the host has taken earlier frames. */
  platen_status (*buffer_alloc)(const platen_host *, uint64_t job_id, uint64_t bytes, platen_buffer *);
  void (*buffer_free)(const platen_host *, platen_buffer *);
  platen_status (*emit)(const platen_host *, uint64_t job_id, const platen_frame *); /* takes the buffer, also when it fails */
  int64_t (*now_mono_ns)(const platen_host *);                                       /* CLOCK_MONOTONIC */
};

typedef struct platen_instance platen_instance;
struct platen_instance {
  uint32_t struct_size, reserved;
  void *data;
  platen_status (*open)(platen_instance *, platen_error *); /* [inst] connects, may block */
  platen_status (*run)(platen_instance *, const platen_job *, const platen_frame *in, uint32_t n_in,
                       platen_error *);               /* [inst] one job, emits its results */
  void (*cancel)(platen_instance *, uint64_t job_id); /* [any] wakes run, returns at once; or NULL */
  void (*close)(platen_instance *);                   /* [inst] disconnects, joins its own threads; open may follow */
  void (*destroy)(platen_instance *);                 /* [inst] no host call after it */
  const void *(*get_extension)(platen_instance *, const char *id); /* [any] or NULL */
};

typedef struct platen_entry {
  uint32_t struct_size, abi_minor;
  platen_status (*init)(const platen_host *, const char *library_dir, platen_error *); /* once, before create */
  void (*deinit)(void);                                                              /* once, at the end; or NULL */
  uint32_t (*count)(void);                                                           /* plugins in this library */
  const platen_desc *(*desc)(uint32_t index); /* constant, also before init; NULL when there is none */
  platen_status (*create)(const platen_host *, const char *id, const platen_value *values, uint32_t n,
                          platen_instance **, platen_error *); /* touches no hardware */
} platen_entry;

/* ---- Payloads: a header at the start of the buffer, then arrays aligned to 8 bytes, at the offsets in the header. ---- */

typedef struct platen_span {
  uint64_t offset, count; /* bytes from the start of the buffer; scalar elements. 0, 0: absent */
} platen_span;

#define PLATEN_FORMAT_SCAN "platen.scan/1"         /* driver -> host, first */
#define PLATEN_FORMAT_COLUMN "platen.column/2"     /* driver -> host */
#define PLATEN_FORMAT_SCAN_END "platen.scan-end/1" /* driver -> host, last */
#define PLATEN_FORMAT_WINDOW "platen.window/1"     /* host -> driver, optional */
#define PLATEN_FORMAT_MESH "platen.mesh/2"         /* host -> flattening */
#define PLATEN_FORMAT_CHART "platen.chart/1"       /* flattening -> host */
#define PLATEN_FORMAT_SURFACE "platen.surface/1"   /* host -> comparison, advisor; role: now, before, baseline */
#define PLATEN_FORMAT_TASK "platen.task/1"         /* host -> comparison, JSON: platen.task-1.json */
#define PLATEN_FORMAT_FINDINGS "platen.findings/1" /* comparison -> host, JSON: platen.findings-1.json */
#define PLATEN_FORMAT_RECORD "platen.record/1"     /* host -> advisor, JSON: platen.record-1.json */
#define PLATEN_FORMAT_ADVICE "platen.advice/1"     /* advisor -> host, JSON: platen.advice-1.json */
#define PLATEN_FORMAT_GRID "platen.grid/1"         /* comparison -> host */

/* Rows run down from the top, columns by increasing azimuth, counter-clockwise seen from above; z is up. */
typedef struct platen_scan {
  uint32_t struct_size, flags; /* 1: simulated, 2: range_error_m is stated */
  uint32_t n_rows, n_columns;
  double azimuth_start, azimuth_step, elevation_start, elevation_step; /* steps positive */
  uint32_t seam_column;                                                /* first of the back face, UINT32_MAX: one face */
  uint16_t intensity_min, intensity_max;
  double acquired_unix_s;        /* 0: unknown */
  platen_span instrument, notes; /* UTF-8; notes: one sentence per line */
  double range_error_m;          /* flag 2: data sheet's range error, one sigma; appended since: may be left out */
} platen_scan;

typedef struct platen_column {
  uint32_t struct_size, index, face, first_row; /* face 0 front, 1 back */
  platen_span range_m;                          /* f64 */
  platen_span azimuth, elevation;               /* f64 */
  platen_span intensity;                        /* u16 */
  platen_span state;                            /* u8: 0 valid, 1 direction only, 2 no return */
} platen_column;

typedef struct platen_scan_end {
  uint32_t struct_size, columns;
  uint64_t points;
  uint32_t warm_up_columns, outcome; /* 0 complete, 1 aborted, 2 failed */
} platen_scan_end;

typedef struct platen_window {
  uint32_t struct_size, reserved;
  double azimuth_start, azimuth_width, elevation_min, elevation_max;
} platen_window;

typedef struct platen_mesh {
  uint32_t struct_size, reserved;
  double width, height, thickness;
  uint32_t corners[4]; /* positions in the boundary loop of (0,0), (W,0), (W,H), (0,H) */
  double corner_sigma[8], edge_sigma[4], edge_length[4];
  platen_span vertices;  /* f64, 3 each, mid-surface */
  platen_span triangles; /* u32, 3 each, counter-clockwise seen from the scanner */
  platen_span boundary;  /* u32, loop counter-clockwise from corner (0,0) */
  platen_span arc;       /* f64, arc length of each boundary vertex from its edge's first corner */
  platen_span places;    /* f64, 2 each: (u, v) of the material at each boundary vertex */
} platen_mesh;

typedef struct platen_chart {
  uint32_t struct_size, reserved;
  platen_span uv, sigma; /* f64: 2 each; sigma may be absent. The host computes strain itself, and refuses what curvature does not explain */
} platen_chart;

/* Mid-surface S(u, v): bicubic B-spline over uniform knots, three beyond each end. Grids are v outer, u inner. */
typedef struct platen_surface {
  uint32_t struct_size, mask_u, mask_v;
  float noise_share; /* share of the covariance that is noise of the scan, the rest is smoothing bias; 0: unknown, all */
  double thickness;
  platen_span knots_u, knots_v;
  platen_span control;          /* f64, 3 each */
  platen_span precision_factor; /* f64: Cholesky factor of the control values' precision; for each row of the net across
                                   its longer axis the blocks that couple it to itself and to the three rows before, each
                                   square over the shorter axis, column-major */
  platen_span covariance;       /* f64, 49 a control point: with those up to three away, 7 x 7 */
  platen_span seen;             /* u8 a mask cell: 1 seen */
} platen_surface;

typedef struct platen_grid {
  uint32_t struct_size, reserved, n_u, n_v, components, reserved_2;
  platen_span name, unit; /* UTF-8 */
  platen_span values;     /* f64, v outer, u inner, components innermost */
  platen_span state;      /* u8 a node: 0 no data, 1 data, 2 data and unchanged */
} platen_grid;

/* Extensions of a scanner instance. */
#define PLATEN_EXT_ESTIMATE "platen.ext.estimate/1"
typedef struct platen_estimate {
  uint32_t struct_size, reserved;
  double (*scan_seconds)(platen_instance *, const platen_window *); /* [inst] negative: unknown */
} platen_estimate;

#define PLATEN_EXT_HEALTH "platen.ext.health/1"
enum { PLATEN_HEALTH_DIRTY = 1, PLATEN_HEALTH_ON_BATTERY = 2, PLATEN_HEALTH_WARMING_UP = 4 };
typedef struct platen_health { /* NAN: not known */
  uint32_t struct_size, flags;
  double temperature_c, battery, tilt; /* battery 0 to 1; tilt of the vertical axis against the plumb line */
} platen_health;
typedef struct platen_health_source {
  uint32_t struct_size, reserved;
  platen_status (*health)(platen_instance *, platen_health *); /* [inst] after open or a job, within 100 ms */
} platen_health_source;

#define PLATEN_EXT_DISCOVERY "platen.ext.discovery/1"
typedef struct platen_device { /* UTF-8 with NUL */
  uint32_t struct_size, reserved;
  char option[32], value[128]; /* what a plant file says to use it */
  char about[128];             /* model and serial number */
} platen_device;
typedef struct platen_discovery {
  uint32_t struct_size, reserved;
  /* [inst] without open: looks for devices for at most 3 s and writes up to n; *found is their number, more than n when some had no place */
  platen_status (*discover)(platen_instance *, platen_device *devices, uint32_t n, uint32_t *found, platen_error *);
} platen_discovery;

#ifdef __cplusplus
}
#endif
#endif
