/* Prints the layout of every struct of platen.h, to be compared with the Rust types. */
#include "platen.h"

#include <stddef.h>
#include <stdio.h>

#define SIZE(type) printf(#type " %zu\n", sizeof(type))
#define FIELD(type, field) printf(#type "." #field " %zu\n", offsetof(type, field))

int main(void) {
  SIZE(platen_error), FIELD(platen_error, message), FIELD(platen_error, hint);
  SIZE(platen_job), FIELD(platen_job, deadline_mono_ns);
  SIZE(platen_buffer), FIELD(platen_buffer, token);
  SIZE(platen_frame), FIELD(platen_frame, format), FIELD(platen_frame, buffer), FIELD(platen_frame, role);
  SIZE(platen_option), FIELD(platen_option, name), FIELD(platen_option, min), FIELD(platen_option, choices);
  SIZE(platen_value), FIELD(platen_value, i), FIELD(platen_value, list), FIELD(platen_value, n);
  SIZE(platen_desc), FIELD(platen_desc, license), FIELD(platen_desc, options), FIELD(platen_desc, n_options);
  SIZE(platen_host), FIELD(platen_host, log), FIELD(platen_host, emit), FIELD(platen_host, now_mono_ns);
  SIZE(platen_instance), FIELD(platen_instance, open), FIELD(platen_instance, get_extension);
  SIZE(platen_entry), FIELD(platen_entry, init), FIELD(platen_entry, create);
  SIZE(platen_scan), FIELD(platen_scan, seam_column), FIELD(platen_scan, notes);
  SIZE(platen_column), FIELD(platen_column, range_m), FIELD(platen_column, state);
  SIZE(platen_scan_end), FIELD(platen_scan_end, points), FIELD(platen_scan_end, outcome);
  SIZE(platen_window), FIELD(platen_window, elevation_max);
  SIZE(platen_mesh), FIELD(platen_mesh, corners), FIELD(platen_mesh, edge_length), FIELD(platen_mesh, arc);
  FIELD(platen_mesh, places);
  SIZE(platen_chart), FIELD(platen_chart, sigma);
  SIZE(platen_surface), FIELD(platen_surface, thickness), FIELD(platen_surface, seen);
  SIZE(platen_grid), FIELD(platen_grid, components), FIELD(platen_grid, state);
  SIZE(platen_estimate), FIELD(platen_estimate, scan_seconds);
  SIZE(platen_health), FIELD(platen_health, tilt);
  SIZE(platen_health_source), FIELD(platen_health_source, health);
  SIZE(platen_device), FIELD(platen_device, option), FIELD(platen_device, value), FIELD(platen_device, about);
  SIZE(platen_discovery), FIELD(platen_discovery, discover);
  return 0;
}
