// SPDX-License-Identifier: Apache-2.0
#include "mjsense/hdf5/h5.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/hdf5/lzf.h"

namespace mjsense::h5 {
namespace {

std::recursive_mutex& library() {
  static std::recursive_mutex mutex;
  return mutex;
}

// The innermost message is the reason ("No space left on device"), the outermost the deed.
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

std::string read_string(hid_t type, auto&& read) {
  if (H5Tis_variable_str(type) > 0) {
    char* text = nullptr;
    const Id memory = text_type();
    read(static_cast<hid_t>(memory), static_cast<void*>(&text));
    std::string result = text ? text : "";
    H5free_memory(text);
    return result;
  }
  std::string text(H5Tget_size(type), '\0');
  read(type, static_cast<void*>(text.data()));
  return text.substr(0, text.find('\0'));
}

}  // namespace

H5Lock::H5Lock() : lock_(library()) {
  static const bool once = [] {
    // Errors are our exceptions, not text on stderr. And after a full disk the library must not
    // try, at exit, to write once more what could not be written.
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
  // A file is closed whole, whatever an error left open in it.
  H5Pset_fclose_degree(access, H5F_CLOSE_STRONG);
  // The library would lock the file, and a program started meanwhile could hold the lock after us.
  // Houses have their own.
  H5Pset_file_locking(access, false, true);
  return access;
}

}  // namespace

Id create_file(const std::filesystem::path& path) {
  const Id creation = plist(H5P_FILE_CREATE);
  H5Pset_obj_track_times(creation, false);
  H5Pset_istore_k(creation, 8);  // small chunk indices: an episode has many datasets of few chunks
  const Id access = file_access();
  return {H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation, access), H5Fclose,
          fmt::format("cannot create '{}'", path.string())};
}

Id open_file(const std::filesystem::path& path, bool writable) {
  const Id access = file_access();
  return {H5Fopen(path.c_str(), writable ? H5F_ACC_RDWR : H5F_ACC_RDONLY, access), H5Fclose,
          fmt::format("cannot open '{}'", path.string())};
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
  while (end != std::string::npos) {  // one by one: intermediate groups made by HDF5 would have
                                      // default properties
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
    if (H5Lexists(parent, path.substr(0, end).c_str(), H5P_DEFAULT) <= 0) return false;
  }
  return true;
}

std::vector<std::string> children(hid_t group) {
  std::vector<std::string> names;
  const auto add = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  check(H5Literate(group, H5_INDEX_NAME, H5_ITER_INC, nullptr, add, &names), "listing a group");
  std::sort(names.begin(), names.end());
  return names;
}

bool is_group(hid_t parent, const std::string& name) {
  const Id object(H5Oopen(parent, name.c_str(), H5P_DEFAULT), H5Oclose, name);
  return H5Iget_type(object) == H5I_GROUP;
}

std::vector<hsize_t> dims(hid_t dataset) {
  const Id space(H5Dget_space(dataset), H5Sclose, "HDF5 space");
  std::vector<hsize_t> sizes(std::max(0, H5Sget_simple_extent_ndims(space)));
  if (!sizes.empty()) H5Sget_simple_extent_dims(space, sizes.data(), nullptr);
  return sizes;
}

void write_text(hid_t parent, const std::string& path, std::string_view text) {
  const std::string owned(text);
  const char* data = owned.c_str();
  const Id type = text_type();
  const Id dataset(H5Dcreate2(parent, path.c_str(), type, scalar(), link_properties(),
                              dataset_properties(), H5P_DEFAULT),
                   H5Dclose, path);
  check(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, &data), path);
}

std::string read_text(hid_t parent, const std::string& path) {
  const Id dataset(H5Dopen2(parent, path.c_str(), H5P_DEFAULT), H5Dclose, path);
  const Id type(H5Dget_type(dataset), H5Tclose, path);
  if (H5Tget_class(type) != H5T_STRING) throw RuntimeError(fmt::format("{}: not a text", path));
  return read_string(type, [&](hid_t memory, void* out) {
    check(H5Dread(dataset, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, out), path);
  });
}

void set_attribute(hid_t object, const char* name, std::string_view value) {
  const std::string owned(value);
  const char* data = owned.c_str();
  const Id type = text_type();
  write_attribute(object, name, type, type, scalar(), &data);
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

bool has_attribute(hid_t object, const char* name) { return H5Aexists(object, name) > 0; }

std::string text_attribute(hid_t object, const char* name) {
  if (!has_attribute(object, name)) return "";
  const Id attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, name);
  const Id type(H5Aget_type(attribute), H5Tclose, name);
  if (H5Tget_class(type) != H5T_STRING) return "";
  return read_string(
      type, [&](hid_t memory, void* out) { check(H5Aread(attribute, memory, out), name); });
}

std::int64_t int_attribute(hid_t object, const char* name, std::int64_t otherwise) {
  if (!has_attribute(object, name)) return otherwise;
  const Id attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, name);
  std::int64_t value = otherwise;
  check(H5Aread(attribute, H5T_NATIVE_INT64, &value), name);
  return value;
}

double double_attribute(hid_t object, const char* name, double otherwise) {
  if (!has_attribute(object, name)) return otherwise;
  const Id attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, name);
  double value = otherwise;
  check(H5Aread(attribute, H5T_NATIVE_DOUBLE, &value), name);
  return value;
}

}  // namespace mjsense::h5
