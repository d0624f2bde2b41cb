// Example of a flattening: the harmonic map, which is correct on plates that were bent without stretching.
//
// c++ -std=c++17 -O2 -shared -fPIC -fvisibility=hidden -I. -o libmy_plugin.so flattening.cpp
#include "platen.hpp"

#include "harmonic_map.h"

class my_plugin {
 public:
  static constexpr platen::about description{"my-plugin",     platen::kind::flattening, "Harmonic map",
                                             "an integrator", "0.1.0",                  "Harmonic map, solved by conjugate gradients.",
                                             "MIT"};
  static std::vector<platen::option> options() { return {}; }

  explicit my_plugin(const platen::values &) {}
  void open() {}
  void close() {}

  void run(const platen::job &job, const platen::inputs &in) {
    const auto &mesh = in.get<platen_mesh>(PLATEN_FORMAT_MESH);
    const std::size_t n = 2 * platen::array<double>(mesh, mesh.vertices).size() / 3;
    std::vector<double> uv(n);
    const auto stopped = [](void *asked) { return static_cast<const platen::job *>(asked)->cancelled() ? 1 : 0; };
    switch (harmonic_map(&mesh, uv.data(), stopped, const_cast<platen::job *>(&job))) {
      case 1: throw std::bad_alloc();
      case 2: job.check(); break;
      case 3: throw platen::failure("the mesh has no harmonic map", "scan again with the whole plate in view");
    }
    const platen_chart head{sizeof head, 0, {sizeof head, n}, {0, 0}};
    job.emit(PLATEN_FORMAT_CHART, sizeof head + n * sizeof(double), [&](char *out) {
      std::memcpy(out, &head, sizeof head);
      std::memcpy(out + sizeof head, uv.data(), n * sizeof(double));
    });
  }
};

PLATEN_PLUGIN(my_plugin)
