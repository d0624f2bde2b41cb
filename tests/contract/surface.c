/* Evaluates the surface of a file with platen_surface.h at a lattice of places, and prints the numbers in full. */
#include "platen_surface.h"

#include <stdio.h>
#include <stdlib.h>

int main(int n_arguments, char **arguments) {
  if (n_arguments != 2) return 2;
  FILE *file = fopen(arguments[1], "rb");
  if (!file || fseek(file, 0, SEEK_END)) return 1;
  long bytes = ftell(file);
  double *data = (double *)malloc((size_t)bytes);
  rewind(file);
  if (!data || fread(data, 1, (size_t)bytes, file) != (size_t)bytes) return 1;
  platen_frame frame = {sizeof frame, 0, PLATEN_FORMAT_SURFACE, "now", {data, (uint64_t)bytes, 0}};
  platen_plate plate;
  if (!platen_plate_of(&frame, 1, "now", &plate)) return 1;
  for (int k = 0; k <= 16; k++)
    for (int i = 0; i <= 22; i++) {
      double u = plate.width * i / 22, v = plate.height * k / 16, normal[3];
      platen_jet jet = platen_jet_at(&plate, u, v);
      platen_normal(&jet, normal);
      platen_curvature bent = platen_curvature_of(&jet);
      printf("%.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %d\n", jet.p[0], jet.p[1], jet.p[2], normal[0], normal[1],
             normal[2], bent.u, bent.v, bent.uv, platen_sigma(&plate, u, v), platen_seen(&plate, u, v));
    }
  free(data);
  return fclose(file);
}
