// SPDX-License-Identifier: Apache-2.0
#include "mjsense/hdf5/h5.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <system_error>

#include "mjsense/core/error.h"
#include "mjsense/hdf5/chunk_checks.h"
#include "mjsense/hdf5/lzf.h"
#include "mjsense/hdf5/untrusted_file.h"

namespace mjsense::hdf5 {
namespace {

std::recursive_mutex& library() {
  static std::recursive_mutex mutex;
  return mutex;
}

bool nobody_else = false;

// The innermost message is the cause ("No space left on device"), the outermost names the
// operation.
std::string library_error() {
  std::string first, last;
  std::pair<std::string*, std::string*> texts{&first, &last};
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_UPWARD,
      [](unsigned n, const H5E_error2_t* error, void* out) -> herr_t {
        auto& [first, last] = *static_cast<std::pair<std::string*, std::string*>*>(out);
        (n == 0 ? *first : *last) = error->desc ? error->desc : "";
        return 0;
      },
      &texts);
  H5Eclear2(H5E_DEFAULT);
  if (const auto at = first.find("error message = '"); at != std::string::npos) {
    first = first.substr(at + 17, first.find('\'', at + 17) - at - 17);
  }
  return last.empty() ? first : fmt::format("{} ({})", first, last);
}

Id plist(hid_t cls) { return {H5Pcreate(cls), H5Pclose, "HDF5 property list"}; }

Id scalar() { return {H5Screate(H5S_SCALAR), H5Sclose, "HDF5 scalar space"}; }

void write_attribute(hid_t object, const char* name, hid_t file_type, hid_t memory, hid_t space,
                     const void* data) {
  const Id attribute(H5Acreate2(object, name, file_type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                     name);
  check(H5Awrite(attribute, memory, data), name);
}

// Throws unless there is exactly one element of this class, of at most `max_bytes`.
void require_one(hid_t space, hid_t type, H5T_class_t cls, std::size_t max_bytes,
                 std::string_view name) {
  const bool simple = H5Sget_simple_extent_type(space) != H5S_NULL;
  const hssize_t count = simple ? H5Sget_simple_extent_npoints(space) : 0;
  if (count != 1) throw RuntimeError(fmt::format("'{}' has {} values, expected 1", name, count));
  const char* expected = cls == H5T_STRING ? "text" : "number";
  if (H5Tget_class(type) != cls)
    throw RuntimeError(fmt::format("'{}' is not a {}", name, expected));
  if (H5Tget_size(type) > max_bytes)
    throw RuntimeError(fmt::format("'{}' is a {} of {} bytes", name, expected, H5Tget_size(type)));
}

std::string read_string(hid_t type, auto&& read) {
  if (H5Tis_variable_str(type) > 0) {
    char* text = nullptr;
    const Id memory = text_type();
    read(static_cast<hid_t>(memory), static_cast<void*>(&text));
    std::string result(text ? text : "", text ? strnlen(text, kMaxTextBytes) : 0);
    H5free_memory(text);
    return result;
  }
  std::string text(H5Tget_size(type), '\0');
  read(type, static_cast<void*>(text.data()));
  return text.substr(0, text.find('\0'));
}

}  // namespace

H5Lock::H5Lock() {
  if (!nobody_else) lock_ = std::unique_lock(library());
  static const bool once = [] {
    // Errors are reported by our exceptions, not as text on stderr. Without H5dont_atexit(), the
    // library would try at exit to write again what failed on a full disk.
    H5dont_atexit();
    H5open();
    register_lzf();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    return true;
  }();
  static thread_local const bool quiet = H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr) >= 0;
  (void)once;
  (void)quiet;
}

void H5Lock::alone() { nobody_else = true; }

Id::Id(hid_t id, herr_t (*close)(hid_t), std::string_view what) : id_(id), close_(close) {
  if (id < 0) throw RuntimeError(fmt::format("{}: {}", what, library_error()));
}

Id& Id::operator=(Id&& other) noexcept {
  if (this != &other) {
    reset();
    id_ = std::exchange(other.id_, -1);
    close_ = other.close_;
  }
  return *this;
}

void Id::reset() {
  if (id_ >= 0) close_(std::exchange(id_, -1));
}

void Id::close(std::string_view what) { check(close_(std::exchange(id_, -1)), what); }

void check(herr_t status, std::string_view what) {
  if (status < 0) throw RuntimeError(fmt::format("{}: {}", what, library_error()));
}

namespace {

Id file_access() {
  Id access = plist(H5P_FILE_ACCESS);
  // Closing a file also closes every object in it that an error left open.
  H5Pset_fclose_degree(access, H5F_CLOSE_STRONG);
  // Disables the library's file locking: a child process that inherits the file could keep the lock
  // after this process ends. Recordings have a lock of their own (record/recording_lock.h).
  H5Pset_file_locking(access, false, true);
  return access;
}

}  // namespace

Id create_file(const std::filesystem::path& path, std::string_view shown) {
  const Id creation = plist(H5P_FILE_CREATE);
  H5Pset_obj_track_times(creation, false);
  // Small chunk indices, because an episode has many datasets with few chunks.
  H5Pset_istore_k(creation, 4);
  const Id access = file_access();
  std::error_code ignored;  // if removal fails, H5Fcreate reports the error
  std::filesystem::remove(path, ignored);
  return {H5Fcreate(path.c_str(), H5F_ACC_EXCL, creation, access), H5Fclose,
          fmt::format("cannot create '{}'", shown.empty() ? path.string() : shown)};
}

Id open_file(const std::filesystem::path& path, bool writable, std::string_view shown) {
  const Id access = file_access();
  return {H5Fopen(path.c_str(), writable ? H5F_ACC_RDWR : H5F_ACC_RDONLY, access), H5Fclose,
          fmt::format("cannot open '{}'", shown.empty() ? path.string() : shown)};
}

Id group_properties() {
  Id list = plist(H5P_GROUP_CREATE);
  H5Pset_obj_track_times(list, false);
  return list;
}

Id dataset_properties() {
  Id list = plist(H5P_DATASET_CREATE);
  H5Pset_obj_track_times(list, false);
  return list;
}

Id link_properties() {
  Id list = plist(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(list, 1);
  H5Pset_char_encoding(list, H5T_CSET_UTF8);
  return list;
}

Id create_group(hid_t parent, const std::string& path) {
  std::size_t end = 0;
  // One by one, because groups that HDF5 creates implicitly have default properties.
  while (end != std::string::npos) {
    end = path.find('/', end + 1);
    const std::string part = path.substr(0, end);
    if (H5Lexists(parent, part.c_str(), H5P_DEFAULT) > 0) continue;
    const Id made(
        H5Gcreate2(parent, part.c_str(), link_properties(), group_properties(), H5P_DEFAULT),
        H5Gclose, part);
  }
  return {H5Gopen2(parent, path.c_str(), H5P_DEFAULT), H5Gclose, path};
}

Id memory_type(DType dtype) {
  const auto copy = [](hid_t type) { return Id(H5Tcopy(type), H5Tclose, "HDF5 type"); };
  switch (dtype) {
    case DType::kFloat32:
      return copy(H5T_IEEE_F32LE);
    case DType::kFloat64:
      return copy(H5T_IEEE_F64LE);
    case DType::kUint8:
      return copy(H5T_STD_U8LE);
    case DType::kUint16:
      return copy(H5T_STD_U16LE);
    case DType::kInt32:
      return copy(H5T_STD_I32LE);
    case DType::kInt64:
      return copy(H5T_STD_I64LE);
    case DType::kBool:
      break;
  }
  Id type(H5Tenum_create(H5T_STD_I8LE), H5Tclose, "HDF5 type");
  std::int8_t value = 0;
  check(H5Tenum_insert(type, "FALSE", &value), "HDF5 type");
  value = 1;
  check(H5Tenum_insert(type, "TRUE", &value), "HDF5 type");
  return type;
}

Id text_type() {
  Id type(H5Tcopy(H5T_C_S1), H5Tclose, "HDF5 type");
  H5Tset_size(type, H5T_VARIABLE);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

bool exists(hid_t parent, const std::string& path) {
  std::size_t end = 0;
  while (end != std::string::npos) {
    end = path.find('/', end + 1);
    const std::string part = path.substr(0, end);
    if (H5Lexists(parent, part.c_str(), H5P_DEFAULT) <= 0) return false;
    H5L_info_t info;
    if (H5Lget_info(parent, part.c_str(), &info, H5P_DEFAULT) < 0 || info.type != H5L_TYPE_HARD)
      return false;
  }
  return true;
}

std::vector<std::string> children(hid_t group) {
  std::vector<std::string> names;
  const auto add = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    auto& all = *static_cast<std::vector<std::string>*>(out);
    all.emplace_back(name);
    return all.size() > kMaxNames ? 1 : 0;
  };
  check(H5Literate(group, H5_INDEX_NAME, H5_ITER_INC, nullptr, add, &names), "listing a group");
  if (names.size() > kMaxNames)
    throw RuntimeError(fmt::format("a group has more than {} names", kMaxNames));
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<hsize_t> dims(hid_t dataset) {
  const Id space(H5Dget_space(dataset), H5Sclose, "HDF5 space");
  std::vector<hsize_t> sizes(std::max(0, H5Sget_simple_extent_ndims(space)));
  if (!sizes.empty()) H5Sget_simple_extent_dims(space, sizes.data(), nullptr);
  return sizes;
}

Id write_text(hid_t parent, const std::string& path, std::string_view text) {
  const std::string owned(text);
  const char* data = owned.c_str();
  const Id type = text_type();
  Id dataset(H5Dcreate2(parent, path.c_str(), type, scalar(), link_properties(),
                        dataset_properties(), H5P_DEFAULT),
             H5Dclose, path);
  check(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, &data), path);
  return dataset;
}

std::string read_text(hid_t parent, const std::string& path) {
  const Id dataset = open_dataset(parent, path);
  check_storage(dataset, path);
  const Id type(H5Dget_type(dataset), H5Tclose, path);
  const Id space(H5Dget_space(dataset), H5Sclose, path);
  require_one(space, type, H5T_STRING, kMaxTextBytes, path);
  check_chunks(dataset, path);
  return read_string(type, [&](hid_t memory, void* out) {
    check(H5Dread(dataset, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, out), path);
  });
}

namespace {

// Created once and never closed: a recording has about a hundred texts, each smaller than the type.
hid_t type_of_texts() {
  static const Id& type = *new Id(text_type());
  return type;
}

}  // namespace

void set_attribute(hid_t object, const char* name, std::string_view value) {
  write_text_attribute(create_text_attribute(object, name), value);
}

Id create_text_attribute(hid_t object, const char* name) {
  static const Id& space = *new Id(scalar());
  return {H5Acreate2(object, name, type_of_texts(), space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
          name};
}

void write_text_attribute(hid_t attribute, std::string_view value) {
  const std::string owned(value);
  const char* data = owned.c_str();
  check(H5Awrite(attribute, type_of_texts(), &data), "an attribute");
}

void set_attribute(hid_t object, const char* name, double value) {
  write_attribute(object, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, scalar(), &value);
}

void set_attribute(hid_t object, const char* name, std::int64_t value) {
  write_attribute(object, name, H5T_STD_I64LE, H5T_NATIVE_INT64, scalar(), &value);
}

void set_attribute(hid_t object, const char* name, std::uint64_t value) {
  write_attribute(object, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, scalar(), &value);
}

void set_attribute(hid_t object, const char* name, std::span<const std::uint64_t> values,
                   std::span<const hsize_t> dims) {
  const Id space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr), H5Sclose,
                 name);
  write_attribute(object, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, space, values.data());
}

bool has_attribute(hid_t object, const char* name) { return H5Aexists(object, name) > 0; }

std::string text_attribute(hid_t object, const char* name) {
  if (!has_attribute(object, name)) return "";
  const Id attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, name);
  const Id type(H5Aget_type(attribute), H5Tclose, name);
  const Id space(H5Aget_space(attribute), H5Sclose, name);
  require_one(space, type, H5T_STRING, kMaxTextBytes, name);
  return read_string(
      type, [&](hid_t memory, void* out) { check(H5Aread(attribute, memory, out), name); });
}

std::int64_t int_attribute(hid_t object, const char* name, std::int64_t otherwise) {
  if (!has_attribute(object, name)) return otherwise;
  const Id attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, name);
  const Id type(H5Aget_type(attribute), H5Tclose, name);
  const Id space(H5Aget_space(attribute), H5Sclose, name);
  require_one(space, type, H5T_INTEGER, sizeof(std::int64_t), name);
  std::int64_t value = otherwise;
  check(H5Aread(attribute, H5T_NATIVE_INT64, &value), name);
  return value;
}

double double_attribute(hid_t object, const char* name, double otherwise) {
  if (!has_attribute(object, name)) return otherwise;
  const Id attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, name);
  const Id type(H5Aget_type(attribute), H5Tclose, name);
  const Id space(H5Aget_space(attribute), H5Sclose, name);
  require_one(space, type, H5T_FLOAT, sizeof(double), name);
  double value = otherwise;
  check(H5Aread(attribute, H5T_NATIVE_DOUBLE, &value), name);
  return value;
}

}  // namespace mjsense::hdf5
