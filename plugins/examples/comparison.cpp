// Example of a comparison: the mean curvature of the plate along u, over the part that was seen.
//
// c++ -std=c++17 -O2 -shared -fPIC -fvisibility=hidden -I. -o libmy_plugin.so comparison.cpp
#include "platen.hpp"

#include "platen_surface.h"

class my_plugin {
 public:
  static constexpr platen::about description{"my-plugin", platen::kind::comparison, "Mean curvature", "an integrator", "0.1.0",
                                             "Mean curvature along u.", "MIT"};
  static std::vector<platen::option> options() {
    return {{"least_seen", nullptr, "Least share of the plate that must have been seen.", "0.5", 0, 1}};
  }

  explicit my_plugin(const platen::values &values) : least_seen_(values.number("least_seen")) {}
  void open() {}
  void close() {}

  void run(const platen::job &job, const platen::inputs &in) {
    platen_plate plate;
    if (!platen_plate_of(in.data(), in.size(), "now", &plate)) throw platen::failure("no surface came", "report this to platen");
    constexpr int side = 101;
    double sum = 0;
    int seen = 0;
    for (int k = 0; k < side; k++) {
      job.check();
      for (int i = 0; i < side; i++) {
        const double u = plate.width * i / (side - 1), v = plate.height * k / (side - 1);
        if (!platen_seen(&plate, u, v)) continue;
        const platen_jet jet = platen_jet_at(&plate, u, v);
        sum += platen_curvature_of(&jet).u, seen++;
      }
    }
    if (seen == 0 || seen < least_seen_ * side * side)
      throw platen::failure("too little of the plate was seen", "scan again with the whole plate in view");
    char json[256];
    std::snprintf(json, sizeof json, "{\"figures\":[{\"name\":\"mean_curvature.u\",\"value\":%.17g,\"unit\":\"1/m\"}]}", sum / seen);
    job.emit(PLATEN_FORMAT_FINDINGS, json);
  }

 private:
  double least_seen_;
};

PLATEN_PLUGIN(my_plugin)
