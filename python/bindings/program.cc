// SPDX-License-Identifier: Apache-2.0
// The `mjsense` program of the Python package.

#include "mjsense/app/program.h"

#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/app/list_command.h"
#include "mjsense/app/text_table.h"
#include "python/bindings/bindings.h"

namespace mjsense::python {

namespace nb = nanobind;

void bind_program(nb::module_& m) {
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
        std::vector<std::string> words;  // file names need not be UTF-8
        for (const nb::bytes& word : given) words.emplace_back(word.c_str(), word.size());
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
