// SPDX-License-Identifier: Apache-2.0
// The `mjsense` program of the Python package.

#include "mjsense/app/program.h"

#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/app/list_command.h"
#include "mjsense/app/text_table.h"
#include "mjsense/record/process.h"
#include "python/bindings/bindings.h"

namespace mjsense::python {

namespace nb = nanobind;

namespace {

std::vector<std::string> strings(const std::vector<nb::bytes>& given) {
  std::vector<std::string> words;  // file names need not be UTF-8
  for (const nb::bytes& word : given) words.emplace_back(word.c_str(), word.size());
  return words;
}

}  // namespace

void bind_program(nb::module_& m) {
  m.def(
      "run_process",
      [](const std::vector<nb::bytes>& given, double silence_s, std::uint64_t cpu_s,
         std::uint64_t memory, std::size_t max_bytes) {
        const std::vector<std::string> argv = strings(given);
        const auto check = [] {
          const nb::gil_scoped_acquire lock;
          if (PyErr_CheckSignals() != 0) throw nb::python_error();
        };
        std::string output;
        {
          const nb::gil_scoped_release unlock;
          output =
              record::run_process(argv, {silence_s, {cpu_s, memory}, max_bytes}, nullptr, check);
        }
        return nb::bytes(output.data(), output.size());
      },
      nb::arg("argv"), nb::arg("silence_s"), nb::arg("cpu_s"), nb::arg("memory"),
      nb::arg("max_bytes"),
      "The stdout of another program, which ends with an error if it exceeds these limits.");
  m.def(
      "objects_json", [] { return app::list_objects(true); },
      "What `mjsense objects --json` prints.");
  m.def(
      "tree_text", [](const std::string& folder) { return app::tree_text(folder); },
      nb::arg("folder"),
      "The files below a folder and their sizes, as `mjsense record` prints them.");
  m.def(
      "run_program",
      [](const std::vector<nb::bytes>& given,
         const std::vector<std::pair<std::string, std::string>>& listed) {
        std::vector<std::string> words = strings(given);
        std::vector<char*> argv;
        for (std::string& word : words) argv.push_back(word.data());
        argv.push_back(nullptr);
        std::vector<app::OtherCommand> others;
        for (const auto& [name, description] : listed) others.push_back({name, description});
        nb::gil_scoped_release unlock;
        const int code = app::run_program(static_cast<int>(words.size()), argv.data(), others);
        std::fflush(stdout);
        return code;
      },
      nb::arg("argv"), nb::arg("others"),
      "The exit code of the program, called with these words. It lists the other commands, pairs "
      "of a "
      "name and a description, which the caller runs.");
}

}  // namespace mjsense::python
