// SPDX-License-Identifier: Apache-2.0
#include "mjsense/hdf5/untrusted_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/hdf5/chunk_checks.h"

namespace mjsense::hdf5 {
namespace {

// Deflate's maximum compression ratio is 1032.
constexpr std::uint64_t kMaxRatio = 1100;
constexpr std::uint64_t kFreeBytes = std::uint64_t{1} << 26;

// Opens one link, which must be a hard link to an object of this file.
Id open_link(hid_t parent, const std::string& name) {
  if (name.empty() || name == "." || name.find('/') != std::string::npos)
    refuse(name, "is not the name of an object");
  H5L_info_t info;
  if (H5Lexists(parent, name.c_str(), H5P_DEFAULT) <= 0) refuse(name, "does not exist");
  check(H5Lget_info(parent, name.c_str(), &info, H5P_DEFAULT), name);
  if (info.type == H5L_TYPE_EXTERNAL) refuse(name, "is an external link, which is not followed");
  if (info.type != H5L_TYPE_HARD) refuse(name, "is a soft link, which is not followed");
  return {H5Oopen(parent, name.c_str(), H5P_DEFAULT), H5Oclose, name};
}

Id open_path(hid_t parent, const std::string& path) {
  Id at;
  for (std::size_t begin = 0, depth = 0; begin <= path.size(); ++depth) {
    if (depth > kMaxDepth) refuse(path, "is nested too deeply");
    const std::size_t end = std::min(path.find('/', begin), path.size());
    at = open_link(at.valid() ? static_cast<hid_t>(at) : parent, path.substr(begin, end - begin));
    begin = end + 1;
  }
  return at;
}

std::uint64_t multiply(std::uint64_t a, std::uint64_t b) {
  std::uint64_t product = 0;
  return __builtin_mul_overflow(a, b, &product) ? std::numeric_limits<std::uint64_t>::max()
                                                : product;
}

// Type of H5Oget_info2()'s result, which since 1.12 is no longer H5O_info_t.
#if H5_VERSION_GE(1, 12, 0)
using ObjectInfo = H5O_info1_t;
#else
using ObjectInfo = H5O_info_t;
#endif

struct Walk {
  const std::function<void(const std::string&)>& visit;
  std::set<haddr_t> above = {};  // addresses of the groups visited so far
  std::size_t names = 0;

  void group(hid_t at, const std::string& prefix, int depth) {
    if (depth > kMaxDepth)
      refuse(prefix, fmt::format("is nested too deeply: more than {} groups", kMaxDepth));
    ObjectInfo info;
    check(H5Oget_info2(at, &info, H5O_INFO_BASIC), prefix);
    if (!above.insert(info.addr).second) refuse(prefix, "is a group that occurs twice");
    for (const std::string& name : children(at)) {
      if (++names > kMaxNames) refuse(prefix, fmt::format("has more than {} names", kMaxNames));
      const Id object = open_link(at, name);
      const H5I_type_t type = H5Iget_type(object);
      if (type == H5I_GROUP) {
        group(object, prefix + name + "/", depth + 1);
      } else if (type == H5I_DATASET) {
        visit(prefix + name);
      } else {
        refuse(prefix + name, "is neither group nor dataset");
      }
    }
  }
};

}  // namespace

void refuse(const std::string& name, std::string_view why) {
  throw RuntimeError(fmt::format("'{}' {}", printable(name), why));
}

Id open_group(hid_t parent, const std::string& path) {
  Id object = open_path(parent, path);
  if (H5Iget_type(object) != H5I_GROUP) refuse(path, "is not a group");
  return object;
}

Id open_dataset(hid_t parent, const std::string& path) {
  Id object = open_path(parent, path);
  if (H5Iget_type(object) != H5I_DATASET) refuse(path, "is not a dataset");
  return object;
}

std::uint64_t check_storage(hid_t dataset, const std::string& name) {
  const Id properties(H5Dget_create_plist(dataset), H5Pclose, name);
  const H5D_layout_t layout = H5Pget_layout(properties);
  if (H5Pget_external_count(properties) != 0)
    refuse(name, "is stored in external files, which are not read");
  if (layout != H5D_COMPACT && layout != H5D_CONTIGUOUS && layout != H5D_CHUNKED)
    refuse(name, "is a virtual dataset, which is not read");
  const Id type(H5Dget_type(dataset), H5Tclose, name);
  const std::uint64_t element = H5Tget_size(type);
  const std::vector<hsize_t> size = dims(dataset);
  std::uint64_t row = element;
  for (std::size_t i = 1; i < size.size(); ++i) row = multiply(row, size[i]);
  if (row > kMaxRowBytes)
    refuse(name, fmt::format("has rows of {} bytes, which is too large", row));
  if (layout == H5D_CHUNKED) {
    hsize_t chunk[H5S_MAX_RANK] = {};
    const int rank = H5Pget_chunk(properties, H5S_MAX_RANK, chunk);
    std::uint64_t bytes = element;
    for (int i = 0; i < rank; ++i) bytes = multiply(bytes, chunk[i]);
    if (bytes > kMaxRowBytes)
      refuse(name, fmt::format("has chunks of {} bytes, which is too large", bytes));
  }
  const std::uint64_t all = size.empty() ? element : multiply(row, size[0]);
  const std::uint64_t stored = H5Dget_storage_size(dataset);
  const std::uint64_t maximum = multiply(stored, kMaxRatio);
  if (all > kFreeBytes && all - kFreeBytes > maximum)
    refuse(name, fmt::format("declares {} bytes but stores {}", all, stored));
  return all;
}

void each_dataset(hid_t group, const std::function<void(const std::string&)>& visit) {
  Walk{visit}.group(group, "", 0);
}

std::string read_bytes(hid_t parent, const std::string& path, std::size_t maximum) {
  const Id dataset = open_dataset(parent, path);
  check_storage(dataset, path);
  const Id type(H5Dget_type(dataset), H5Tclose, path);
  const std::vector<hsize_t> size = dims(dataset);
  if (H5Tget_class(type) != H5T_INTEGER || H5Tget_size(type) != 1 || size.size() != 1)
    refuse(path, "is not a one-dimensional array of bytes");
  if (size[0] > maximum)
    refuse(path, fmt::format("has {} bytes, expected at most {}", size[0], maximum));
  check_chunks(dataset, path);
  std::string bytes(size[0], '\0');
  if (!bytes.empty())
    check(H5Dread(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), path);
  return bytes;
}

}  // namespace mjsense::hdf5
