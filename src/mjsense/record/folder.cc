// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/folder.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <span>

#include "mjsense/core/error.h"
#include "mjsense/core/files/file_size_limit.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/os.h"

namespace fs = std::filesystem;

namespace mjsense::record {
namespace {

constexpr int kFolderFlags = O_RDONLY | O_DIRECTORY | O_CLOEXEC;

bool same_file(const struct stat& a, const struct stat& b) {
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

bool is_entry(int folder, const std::string& name, int fd) {
  struct stat entry = {}, file = {};
  return fstatat(folder, name.c_str(), &entry, AT_SYMLINK_NOFOLLOW) == 0 && fstat(fd, &file) == 0 &&
         same_file(entry, file);
}

std::vector<std::string> names_in(int folder) {
  std::vector<std::string> names;
  // A separate open file, because the read position of a directory belongs to the open file.
  Fd own(openat(folder, ".", kFolderFlags));
  if (!own) return names;
  const std::unique_ptr<DIR, int (*)(DIR*)> entries(fdopendir(own.get()), closedir);
  if (!entries) return names;
  static_cast<void>(own.release());
  while (const dirent* entry = readdir(entries.get())) {
    const std::string_view name = entry->d_name;
    if (name != "." && name != "..") names.emplace_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

void remove_entry(int folder, const std::string& name) {
  if (unlinkat(folder, name.c_str(), 0) == 0 || (errno != EISDIR && errno != EPERM)) return;
  {
    const Fd inner(openat(folder, name.c_str(), kFolderFlags | O_NOFOLLOW));
    if (!inner) return;
    for (const std::string& entry : names_in(inner.get())) remove_entry(inner.get(), entry);
  }
  unlinkat(folder, name.c_str(), AT_REMOVEDIR);
}

}  // namespace

void throw_file(std::string_view action, const fs::path& path, int error) {
  throw RuntimeError(
      fmt::format("cannot {} '{}': {}", action, path.string(), std::strerror(error)));
}

Folder Folder::open(const fs::path& path) {
  Fd fd(::open(path.empty() ? "." : path.c_str(), kFolderFlags));
  if (!fd) throw_file("open the directory", path, errno);
  return {std::move(fd), path};
}

fs::path Folder::fd_path(const std::string& name) const { return os::path_of(fd()) / name; }

Folder Folder::find_dir(const std::string& name) const {
  Fd inner(openat(fd(), name.c_str(), kFolderFlags | O_NOFOLLOW));
  if (inner) return {std::move(inner), path_ / name};
  const int error = errno;
  if (error == ENOENT) return {};
  struct stat about = {};
  if (fstatat(fd(), name.c_str(), &about, AT_SYMLINK_NOFOLLOW) == 0 && S_ISLNK(about.st_mode))
    throw ValueError(fmt::format("'{}' is a symbolic link, which is not followed: remove it",
                                 display_path(name)));
  throw_file("open the directory", display_path(name), error);
}

Folder Folder::open_dir(const std::string& name) const {
  Folder inner = find_dir(name);
  if (!inner) throw_file("open the directory", display_path(name), ENOENT);
  return inner;
}

Folder Folder::make_dir(const std::string& name) const {
  if (mkdirat(fd(), name.c_str(), 0755) != 0)
    throw_file("create the directory", display_path(name), errno);
  return open_dir(name);
}

bool Folder::contains(const std::string& name) const {
  struct stat about = {};
  return fstatat(fd(), name.c_str(), &about, AT_SYMLINK_NOFOLLOW) == 0;
}

bool Folder::contains(const std::string& name, const Fd& file) const {
  return is_entry(fd(), name, file.get());
}

bool Folder::contains(const std::string& name, const Folder& f) const {
  return is_entry(fd(), name, f.fd());
}

bool Folder::is_at_its_path() const {
  struct stat named = {}, ours = {};
  return stat(path_.empty() ? "." : path_.c_str(), &named) == 0 && fstat(fd(), &ours) == 0 &&
         same_file(named, ours);
}

bool Folder::is_plain_file(const std::string& name) const {
  struct stat about = {};
  return fstatat(fd(), name.c_str(), &about, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(about.st_mode);
}

std::int64_t Folder::size_of(const std::string& name) const {
  struct stat about = {};
  const bool found = fstatat(fd(), name.c_str(), &about, AT_SYMLINK_NOFOLLOW) == 0;
  return found && S_ISREG(about.st_mode) ? static_cast<std::int64_t>(about.st_size) : 0;
}

std::vector<std::string> Folder::names() const { return names_in(fd()); }

void Folder::sync() const {
  if (fsync(fd()) != 0) throw_file("sync", path_, errno);
}

void Folder::sync(const std::string& name) const {
  const Fd file(openat(fd(), name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!file || fsync(file.get()) != 0) throw_file("sync", display_path(name), errno);
}

void Folder::rename(const std::string& name, const Folder& to, const std::string& new_name) const {
  if (renameat(fd(), name.c_str(), to.fd(), new_name.c_str()) != 0)
    throw_file("write", to.display_path(new_name), errno);
}

void Folder::write(const std::string& name, std::string_view text) const {
  const FileLimitGuard limit;
  const std::string part = name + ".part";
  unlinkat(fd(), part.c_str(), 0);
  {
    const Fd file(
        openat(fd(), part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644));
    if (!file || !write_all(file, std::as_bytes(std::span(text))) || fsync(file.get()) != 0) {
      const int error = errno;
      unlinkat(fd(), part.c_str(), 0);
      throw_file("write", display_path(name), error);
    }
  }
  rename(part, *this, name);
}

void Folder::reserve_space(const std::string& name, std::int64_t bytes) const {
  const Fd file(openat(fd(), name.c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC));
  if (!file) throw_file("write", display_path(name), errno);
  rlimit limit{};
  if (getrlimit(RLIMIT_FSIZE, &limit) == 0 && limit.rlim_cur < static_cast<rlim_t>(bytes))
    throw_file("write", display_path(name), EFBIG);
  if (os::reserve(file.get(), bytes)) return;
  if (errno == ENOSPC || errno == EDQUOT || errno == EFBIG)
    throw_file("write", display_path(name), errno);
  // If space cannot be reserved (some network file systems), at least check that enough is free.
  std::error_code error;
  const fs::space_info space = fs::space(os::path_of(file.get()), error);
  if (!error && space.available < static_cast<std::uintmax_t>(bytes))
    throw_file("write", display_path(name), ENOSPC);
}

void Folder::remove(const std::string& name) const { remove_entry(fd(), name); }

bool Folder::remove(const std::string& name, const Folder& inner) const {
  for (const std::string& entry : inner.names()) inner.remove(entry);
  return contains(name, inner) && unlinkat(fd(), name.c_str(), AT_REMOVEDIR) == 0;
}

}  // namespace mjsense::record
