// Example of a scanner driver: a level floor, `height` metres below the scanner.
//
// c++ -std=c++17 -O2 -shared -fPIC -fvisibility=hidden -I. -o libmy_plugin.so scanner.cpp
#include "platen.hpp"

#include <cmath>

class my_plugin {
 public:
  static constexpr platen::about description{"my-plugin", platen::kind::scanner, "Plane scanner", "an integrator", "0.1.0",
                                             "Sees a level floor.", "MIT"};
  static std::vector<platen::option> options() {
    return {{"height", "m", "Height of the scanner over the floor.", "2.0", 0.1, 100}};
  }

  explicit my_plugin(const platen::values &values) : height_(values.number("height")) {}
  void open() {}
  void close() {}

  void run(const platen::job &job, const platen::inputs &) {
    const platen_scan scan{sizeof scan, 0, rows, columns, 0, step, top, step, UINT32_MAX, 0, 2047, 0, {0, 0}, {0, 0}, 0};
    put(job, PLATEN_FORMAT_SCAN, scan);
    for (std::uint32_t index = 0; index < columns; index++) {
      job.check();
      job.progress(double(index) / columns, "scanning");
      column(job, index);
    }
    const platen_scan_end end{sizeof end, columns, std::uint64_t(rows) * columns, 0, 0};
    put(job, PLATEN_FORMAT_SCAN_END, end);
  }

 private:
  static constexpr std::uint32_t rows = 60, columns = 80;
  static constexpr double step = 0.01, top = -0.3;
  double height_;

  template <class Head> static void put(const platen::job &job, const char *format, const Head &head) {
    job.emit(format, sizeof head, [&](char *out) { std::memcpy(out, &head, sizeof head); });
  }

  void column(const platen::job &job, std::uint32_t index) const {
    std::uint64_t bytes = sizeof(platen_column);
    const auto next = [&](std::uint64_t size) {
      const platen_span place{bytes, rows};
      bytes += rows * size;
      return place;
    };
    platen_column head{sizeof head, index, 0, 0, {}, {}, {}, {}, {}};
    head.range_m = next(8), head.azimuth = next(8), head.elevation = next(8), head.intensity = next(2), head.state = next(1);
    job.emit(PLATEN_FORMAT_COLUMN, bytes, [&](char *out) {
      std::memcpy(out, &head, sizeof head);
      for (std::uint32_t row = 0; row < rows; row++) {
        const double elevation = top - step * row, azimuth = step * index, range = height_ / -std::sin(elevation);
        const std::uint16_t intensity = 1000;
        std::memcpy(out + head.range_m.offset + 8 * row, &range, 8);
        std::memcpy(out + head.azimuth.offset + 8 * row, &azimuth, 8);
        std::memcpy(out + head.elevation.offset + 8 * row, &elevation, 8);
        std::memcpy(out + head.intensity.offset + 2 * row, &intensity, 2);
        out[head.state.offset + row] = 0;
      }
    });
  }
};

PLATEN_PLUGIN(my_plugin)
