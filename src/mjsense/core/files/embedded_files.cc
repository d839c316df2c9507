// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/embedded_files.h"

#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"

namespace mjsense {

std::string_view embedded_file(std::string_view name) {
  return find_named(embedded_files(), &EmbeddedFile::name, name, "models", "embedded file").text;
}

}  // namespace mjsense
