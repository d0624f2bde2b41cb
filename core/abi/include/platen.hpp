// platen.hpp - plugins in C++17 over platen.h, header-only: a class per plugin, exceptions become errors, spans instead of pointers.
//
//   class my_plugin {
//    public:
//     static constexpr platen::about description{"my-plugin", platen::kind::flattening, "My plugin", "an integrator", "0.1.0", "What it does.", "MIT"};
//     static std::vector<platen::option> options() { return {}; }
//     explicit my_plugin(const platen::values &) {}
//     void open() {}                                          // a scanner connects here, again after a failure
//     void close() {}                                         // and disconnects here
//     void run(const platen::job &job, const platen::inputs &in) { ... }
//   };
//   PLATEN_PLUGIN(my_plugin)
//
// Throw platen::failure for a sentence with advice; any other exception becomes an error of its what().
#ifndef PLATEN_HPP
#define PLATEN_HPP

#include "platen.h"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace platen {

// Memory of somebody else.
template <class T> class span {
 public:
  span() = default;
  span(T *data, std::size_t size) : data_(data), size_(size) {}
  T *data() const { return data_; }
  std::size_t size() const { return size_; }
  T *begin() const { return data_; }
  T *end() const { return data_ + size_; }
  T &operator[](std::size_t k) const { return data_[k]; }

 private:
  T *data_ = nullptr;
  std::size_t size_ = 0;
};

// The elements of an array of a payload.
template <class T, class Head> span<const T> array(const Head &head, platen_span of) {
  return {reinterpret_cast<const T *>(reinterpret_cast<const char *>(&head) + of.offset), static_cast<std::size_t>(of.count)};
}

// A reason for people: what happened, and what to do.
class failure : public std::runtime_error {
 public:
  explicit failure(const std::string &message, std::string hint = {}, platen_status status = PLATEN_E_BAD_DATA)
      : std::runtime_error(message), hint_(std::move(hint)), status_(status) {}
  const std::string &hint() const { return hint_; }
  platen_status status() const { return status_; }

 private:
  std::string hint_;
  platen_status status_;
};

enum class kind { scanner, flattening, comparison };

struct about {
  const char *id;
  platen::kind kind;
  const char *name, *vendor, *version, *doc, *license;
};

// An option: a number between two others, or a text (the address of a device), with its default as TOML text; nullptr: required.
struct option {
  const char *name, *unit, *doc, *default_text;
  double min = 0, max = 0;
  platen_option raw() const {
    const bool number = min < max;
    const std::uint32_t flags = (number ? PLATEN_OPTION_HAS_MIN | PLATEN_OPTION_HAS_MAX : 0) | (default_text ? 0 : PLATEN_OPTION_REQUIRED);
    return {sizeof(platen_option), number ? PLATEN_TYPE_FLOAT : PLATEN_TYPE_STRING, flags, 0, name, unit, doc, default_text, min, max, nullptr};
  }
};

// The values of the options, checked by the host.
class values {
 public:
  values(const platen_value *data, std::uint32_t n) : all_(data, n) {}
  double number(const char *name) const { return find(name).f; }
  std::string text(const char *name) const { return find(name).s; }

 private:
  const platen_value &find(const char *name) const {
    for (const platen_value &value : all_)
      if (std::strcmp(value.name, name) == 0) return value;
    throw failure(std::string("option ") + name + " is missing", "report this to the plugin's author", PLATEN_E_CONFIG);
  }
  span<const platen_value> all_;
};

// What the host sent with a job.
class inputs {
 public:
  inputs(const platen_frame *data, std::uint32_t n) : all_(data, n) {}
  // The header of the frame of a format, and of a role where several have it: now, before, baseline.
  template <class Head> const Head &get(const char *format, const char *role = nullptr) const {
    for (const platen_frame &frame : all_)
      if (std::strcmp(frame.format, format) == 0 && (!role || (frame.role && std::strcmp(frame.role, role) == 0)))
        return *static_cast<const Head *>(frame.buffer.data);
    throw failure(std::string("no ") + format + " came", "report this to platen", PLATEN_E_NO_DATA);
  }
  const platen_frame *data() const { return all_.data(); }
  std::uint32_t size() const { return static_cast<std::uint32_t>(all_.size()); }

 private:
  span<const platen_frame> all_;
};

// One job: cancellation, progress, results.
class job {
 public:
  job(const platen_host *host, const platen_job *raw) : host_(host), raw_(raw) {}
  const platen_job &raw() const { return *raw_; }
  bool cancelled() const { return host_->cancelled(host_, raw_->job_id) != 0; }
  // Ends the job when it was cancelled, or its deadline has passed.
  void check() const {
    if (cancelled()) throw failure("cancelled", {}, PLATEN_E_CANCELLED);
  }
  void progress(double fraction, const char *phase) const { host_->progress(host_, raw_->job_id, fraction, phase); }
  // Emits bytes of so many, which `fill` writes into the host's buffer.
  template <class Fill> void emit(const char *format, std::size_t bytes, Fill &&fill) const {
    platen_frame frame{sizeof frame, 0, format, nullptr, {nullptr, 0, 0}};
    expect(host_->buffer_alloc(host_, raw_->job_id, bytes, &frame.buffer));
    try {
      fill(static_cast<char *>(frame.buffer.data));
    } catch (...) {
      host_->buffer_free(host_, &frame.buffer);
      throw;
    }
    expect(host_->emit(host_, raw_->job_id, &frame));
  }
  void emit(const char *format, const std::string &text) const {
    emit(format, text.size(), [&](char *out) { std::memcpy(out, text.data(), text.size()); });
  }

 private:
  static void expect(platen_status status) {
    if (status != PLATEN_OK) throw failure("the host takes no result", {}, status);
  }
  const platen_host *host_;
  const platen_job *raw_;
};

namespace detail {

inline const platen_host *host = nullptr;

inline void tell(platen_error *error, const char *message, const char *hint) {
  std::snprintf(error->message, sizeof error->message, "%s", message);
  std::snprintf(error->hint, sizeof error->hint, "%s", hint);
}

// Calls, and turns exceptions into errors.
template <class Call> platen_status guarded(platen_error *error, Call &&call) noexcept {
  try {
    call();
    return PLATEN_OK;
  } catch (const failure &reason) {
    tell(error, reason.what(), reason.hint().c_str());
    return reason.status();
  } catch (const std::bad_alloc &) {
    tell(error, "no memory", "give the plugin more: memory_mib in the plant file");
    return PLATEN_E_MEMORY;
  } catch (const std::exception &reason) {
    tell(error, reason.what(), "report this to the plugin's author");
    return PLATEN_E_INTERNAL;
  } catch (...) {
    tell(error, "an exception of an unknown type", "report this to the plugin's author");
    return PLATEN_E_INTERNAL;
  }
}

template <class Plugin> struct tables {
  static Plugin &of(platen_instance *self) { return *static_cast<Plugin *>(self->data); }

  static platen_status open(platen_instance *self, platen_error *error) noexcept {
    return guarded(error, [&] { of(self).open(); });
  }
  static platen_status run(platen_instance *self, const platen_job *raw, const platen_frame *in, std::uint32_t n,
                           platen_error *error) noexcept {
    return guarded(error, [&] { of(self).run(job(host, raw), inputs(in, n)); });
  }
  static void close(platen_instance *self) noexcept {
    platen_error ignored{};
    guarded(&ignored, [&] { of(self).close(); });
  }
  static void destroy(platen_instance *self) noexcept {
    platen_error ignored{};
    guarded(&ignored, [&] { delete &of(self); });
    delete self;
  }

  static platen_status init(const platen_host *given, const char *, platen_error *) noexcept {
    host = given;
    return PLATEN_OK;
  }
  static std::uint32_t count() noexcept { return 1; }
  static const platen_desc *desc(std::uint32_t index) noexcept {
    platen_error ignored{};
    const platen_desc *made = nullptr;
    guarded(&ignored, [&] { made = index == 0 ? describe() : nullptr; });
    return made;
  }
  static const platen_desc *describe() {
    static const std::vector<platen_option> options = [] {
      std::vector<platen_option> made;
      for (const option &it : Plugin::options()) made.push_back(it.raw());
      return made;
    }();
    static const char *const formats[3][2][4] = {
        {{PLATEN_FORMAT_WINDOW, nullptr}, {PLATEN_FORMAT_SCAN, PLATEN_FORMAT_COLUMN, PLATEN_FORMAT_SCAN_END, nullptr}},
        {{PLATEN_FORMAT_MESH, nullptr}, {PLATEN_FORMAT_CHART, nullptr}},
        {{PLATEN_FORMAT_TASK, PLATEN_FORMAT_SURFACE, nullptr}, {PLATEN_FORMAT_FINDINGS, PLATEN_FORMAT_GRID, nullptr}}};
    static const char *const kinds[] = {"scanner", "flattening", "comparison"};
    constexpr about it = Plugin::description;
    constexpr int of_kind = static_cast<int>(it.kind);
    static const platen_desc made{sizeof(platen_desc), 0, it.id, kinds[of_kind], it.name, it.vendor, it.version, it.doc, nullptr,
                                  it.license, formats[of_kind][0], formats[of_kind][1], options.data(),
                                  static_cast<std::uint32_t>(options.size()), 0};
    return &made;
  }
  static platen_status create(const platen_host *, const char *, const platen_value *given, std::uint32_t n, platen_instance **out,
                              platen_error *error) noexcept {
    return guarded(error, [&] {
      auto plugin = std::make_unique<Plugin>(values(given, n));
      *out = new platen_instance{sizeof(platen_instance), 0, plugin.get(), open, run, nullptr, close, destroy, nullptr};
      plugin.release();
    });
  }
};

}  // namespace detail
}  // namespace platen

// Exports the one plugin of a library.
#define PLATEN_PLUGIN(Class)                                                                                                       \
  PLATEN_EXPORT const platen_entry platen_entry_2;                                                                                 \
  const platen_entry platen_entry_2 = {sizeof(platen_entry),                  PLATEN_ABI_MINOR,                                    \
                                       platen::detail::tables<Class>::init,   nullptr,                                             \
                                       platen::detail::tables<Class>::count,  platen::detail::tables<Class>::desc,                 \
                                       platen::detail::tables<Class>::create};

#endif
