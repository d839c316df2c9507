// SPDX-License-Identifier: Apache-2.0
// What the commands of the program need and the package does not: tools for recordings, and limited
// processes.

#include <nanobind/nanobind.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/record/process.h"
#include "mjsense/replay/recording_tools.h"
#include "mjsense/scene/mujoco_log.h"
#include "python/bindings/bindings.h"

namespace mjsense::python {

namespace nb = nanobind;

namespace {

using Path = std::filesystem::path;

nb::bytes bytes(const std::string& text) { return nb::bytes(text.data(), text.size()); }

// Calls a function of C++ while other threads of Python run.
template <class Function>
auto unlocked(Function&& function) {
  const nb::gil_scoped_release unlock;
  return function();
}

// Text, whose names of files need not be UTF-8, and JSON.
std::pair<nb::bytes, std::string> inspect(const Path& path) {
  const auto result = unlocked([&] { return replay::inspect(path); });
  return {bytes(result.text()), result.json()};
}

std::string verify(const Path& path, bool decode, const std::string& ffmpeg, nb::object progress) {
  replay::VerifyOptions options{.decode = decode, .ffmpeg = ffmpeg, .progress = {}};
  if (!progress.is_none()) {
    options.progress = [&](const std::string& text) {
      const nb::gil_scoped_acquire lock;
      progress(text);
    };
  }
  return unlocked([&] { return replay::verify(path, options).json(); });
}

std::string repair(const Path& path) {
  return unlocked([&] { return replay::repair(path).json(); });
}

std::string contact_sheet(const Path& path, const Path& png, const std::string& ffmpeg) {
  return unlocked([&] { return replay::contact_sheet(path, png, 4, 8, ffmpeg); });
}

nb::bytes run_process(const std::vector<nb::bytes>& given, double silence_s, std::uint64_t cpu_s,
                      std::uint64_t memory, std::size_t max_bytes) {
  std::vector<std::string> argv;  // file names need not be UTF-8
  for (const nb::bytes& word : given) argv.emplace_back(word.c_str(), word.size());
  const auto check = [] {
    const nb::gil_scoped_acquire lock;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
  };
  return bytes(unlocked([&] {
    return record::run_process(argv, {silence_s, {cpu_s, memory}, max_bytes}, nullptr, check);
  }));
}

}  // namespace

void bind_program(nb::module_& m) {
  m.def("run_process", &run_process, nb::arg("argv"), nb::arg("silence_s"), nb::arg("cpu_s"),
        nb::arg("memory"), nb::arg("max_bytes"),
        "The stdout of another program, which ends with an error if it exceeds these limits.");
  m.def("inspect", &inspect, nb::arg("path"),
        "Contents and statistics of a recording as text and as JSON.");
  m.def("verify", &verify, nb::arg("path"), nb::arg("decode"), nb::arg("ffmpeg"),
        nb::arg("progress").none(),
        "Whether a recording is complete and undamaged, as JSON. `progress` is called with a text "
        "after each file.");
  m.def("repair", &repair, nb::arg("path"),
        "Publishes the finished episodes of an interrupted recording. Returns what was done and "
        "what could not be done, as JSON.");
  m.def("contact_sheet", &contact_sheet, nb::arg("path"), nb::arg("png"), nb::arg("ffmpeg"),
        "Writes a picture of a recording's cameras. Returns which episodes it shows.");
  m.def("print_warnings_once", &scene::print_warnings_once,
        "Prints each of MuJoCo's warnings once from now on, on stderr.");
}

}  // namespace mjsense::python
