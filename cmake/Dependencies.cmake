# SPDX-License-Identifier: Apache-2.0
# Everything mjsense links. Debian packages (apt.txt) and the wheel mujoco-core; nothing is downloaded at configure time.

# Supported series of MuJoCo: any 4.0.x. tests/python/test_installed.py checks that pyproject.toml and the Python code state the
# same series.
set(MJSENSE_MUJOCO 4.0)

# The installed package reads this file too (mjsenseConfig.cmake). A missing dependency makes find_package(mjsense) fail there and
# is an error here.
macro(mjsense_find)
  if(CMAKE_FIND_PACKAGE_NAME STREQUAL "mjsense")
    find_dependency(${ARGN})
  else()
    find_package(${ARGN} REQUIRED)
  endif()
endmacro()
macro(mjsense_missing text)
  if(CMAKE_FIND_PACKAGE_NAME STREQUAL "mjsense")
    set(mjsense_FOUND FALSE)
    set(mjsense_NOT_FOUND_MESSAGE "${text}")
    return()
  endif()
  message(FATAL_ERROR "${text}")
endmacro()

mjsense_find(Threads)
mjsense_find(fmt)
mjsense_find(nlohmann_json)
mjsense_find(PkgConfig)
pkg_check_modules(PCRE2 QUIET IMPORTED_TARGET libpcre2-8)
if(NOT PCRE2_FOUND)
  mjsense_missing("libpcre2-8 not found: apt-get install libpcre2-dev")
endif()
pkg_check_modules(DEFLATE QUIET IMPORTED_TARGET libdeflate)
if(NOT DEFLATE_FOUND)
  mjsense_missing("libdeflate not found: apt-get install libdeflate-dev")
endif()

# MuJoCo is taken from the wheel of the configuring Python, so that the C++ code and `import mujoco` use the same library. A toolchain for
# another CPU sets MUJOCO_DIR.
mjsense_find(Python 3.11 COMPONENTS Interpreter)
if(NOT CMAKE_CROSSCOMPILING)
  execute_process(
    COMMAND ${Python_EXECUTABLE} -c
            "import importlib.util as u; s = u.find_spec('mujoco'); print(s.submodule_search_locations[0] if s else '')"
    OUTPUT_VARIABLE MUJOCO_DIR OUTPUT_STRIP_TRAILING_WHITESPACE)
endif()
file(GLOB MUJOCO_LIBRARIES "${MUJOCO_DIR}/libmujoco.so.${MJSENSE_MUJOCO}.*")
if(NOT MUJOCO_DIR OR NOT MUJOCO_LIBRARIES)
  mjsense_missing("MuJoCo ${MJSENSE_MUJOCO} not found in ${Python_EXECUTABLE}: run ./dev setup, or pip install \
'mujoco-core==${MJSENSE_MUJOCO}.*' there, or name another Python by -DPython_EXECUTABLE=...")
endif()
list(GET MUJOCO_LIBRARIES -1 MUJOCO_LIBRARY)
if(NOT TARGET mujoco::mujoco)
  add_library(mujoco::mujoco SHARED IMPORTED GLOBAL)
  set_target_properties(mujoco::mujoco PROPERTIES IMPORTED_LOCATION ${MUJOCO_LIBRARY}
                                                  INTERFACE_INCLUDE_DIRECTORIES ${MUJOCO_DIR}/include)
endif()

# Embree 4 if found, else 3 (Debian 12); rays/embree.h hides the difference.
find_package(embree 4 QUIET)
if(NOT embree_FOUND)
  mjsense_find(embree 3)
endif()

# OMPL with Eigen, for the motion planning of mjsense_tasks. Its CMake package is not used, because it requires headers and libraries that
# Debian does not install with it.
if(NOT CMAKE_FIND_PACKAGE_NAME STREQUAL "mjsense" OR mjsense_tasks_FOUND)
  find_library(OMPL_LIBRARY ompl)
  find_path(OMPL_INCLUDE ompl/config.h PATH_SUFFIXES ompl-1.5 ompl-1.6)
  find_path(EIGEN_INCLUDE Eigen/Core PATH_SUFFIXES eigen3)
  if(NOT OMPL_LIBRARY OR NOT OMPL_INCLUDE OR NOT EIGEN_INCLUDE)
    mjsense_missing("libompl not found: apt-get install libompl-dev")
  endif()
  if(NOT TARGET ompl::ompl)
    add_library(ompl::ompl SHARED IMPORTED GLOBAL)
    set_target_properties(ompl::ompl PROPERTIES IMPORTED_LOCATION ${OMPL_LIBRARY}
                                                INTERFACE_INCLUDE_DIRECTORIES "${OMPL_INCLUDE};${EIGEN_INCLUDE}")
  endif()
endif()

# The serial HDF5 C library, static, so that a file written here never depends on a user's libhdf5.
find_library(HDF5_STATIC NAMES libhdf5.a PATHS /usr/lib/x86_64-linux-gnu/hdf5/serial /usr/lib/aarch64-linux-gnu/hdf5/serial)
find_path(HDF5_INCLUDE hdf5.h PATHS /usr/include/hdf5/serial)
find_library(SZ_STATIC libsz.a)
find_library(AEC_STATIC libaec.a)
if(NOT HDF5_STATIC OR NOT HDF5_INCLUDE)
  mjsense_missing("libhdf5.a not found: apt-get install libhdf5-dev")
endif()
mjsense_find(ZLIB)
set(HDF5_LIBRARIES_OF_IT ${SZ_STATIC} ${AEC_STATIC} ZLIB::ZLIB ${CMAKE_DL_LIBS} m)
# Debian 13's HDF5 can read from Amazon S3 and needs further libraries for this, which libhdf5-dev installs.
include(CheckCXXSourceCompiles)
set(CMAKE_REQUIRED_LIBRARIES ${HDF5_STATIC} ${HDF5_LIBRARIES_OF_IT})
check_cxx_source_compiles("extern \"C\" int H5open(); int main() { return H5open(); }" MJSENSE_HDF5_LINKS)
unset(CMAKE_REQUIRED_LIBRARIES)
if(NOT MJSENSE_HDF5_LINKS)
  find_library(CURL_OF_HDF5 curl)
  find_library(CRYPTO_OF_HDF5 crypto)
  if(NOT CURL_OF_HDF5 OR NOT CRYPTO_OF_HDF5)
    mjsense_missing("${HDF5_STATIC} does not link without libcurl and libcrypto: apt-get install libcurl4-openssl-dev libssl-dev")
  endif()
  list(APPEND HDF5_LIBRARIES_OF_IT ${CURL_OF_HDF5} ${CRYPTO_OF_HDF5})
endif()
if(NOT TARGET mjsense_hdf5)
  add_library(mjsense_hdf5 INTERFACE)
  target_include_directories(mjsense_hdf5 INTERFACE $<BUILD_INTERFACE:${HDF5_INCLUDE}>)
  target_link_libraries(mjsense_hdf5 INTERFACE ${HDF5_STATIC} ${HDF5_LIBRARIES_OF_IT})
endif()

# The distribution's libraries are built with its newest GCC. An older GCC, if selected, links its own libstdc++, which may lack symbols
# that they need. At run time the newest libstdc++ is loaded, so link this one.
foreach(name libstdc++.so libstdc++.so.6)
  execute_process(COMMAND ${CMAKE_CXX_COMPILER} -print-file-name=${name} OUTPUT_VARIABLE MJSENSE_FOUND OUTPUT_STRIP_TRAILING_WHITESPACE)
  get_filename_component(MJSENSE_FOUND "${MJSENSE_FOUND}" REALPATH)
  list(APPEND MJSENSE_LIBSTDCXX "${MJSENSE_FOUND}")
endforeach()
list(GET MJSENSE_LIBSTDCXX 0 MJSENSE_LINKED)
list(GET MJSENSE_LIBSTDCXX 1 MJSENSE_LOADED)
if(NOT MJSENSE_LINKED STREQUAL MJSENSE_LOADED AND EXISTS "${MJSENSE_LOADED}" AND NOT MJSENSE_STATIC)
  string(APPEND CMAKE_CXX_STANDARD_LIBRARIES " ${MJSENSE_LOADED}")
endif()

# What each library links, and all of it.
set(MJSENSE_PRIVATE_LIBS fmt::fmt nlohmann_json::nlohmann_json PkgConfig::PCRE2 PkgConfig::DEFLATE embree mjsense_hdf5 Threads::Threads)
set(MJSENSE_TASKS_PRIVATE_LIBS fmt::fmt nlohmann_json::nlohmann_json ompl::ompl)
if(MJSENSE_STATIC)
  include(StaticLibraries)
endif()
set(MJSENSE_ALL_LIBS ${MJSENSE_PRIVATE_LIBS} ${MJSENSE_TASKS_PRIVATE_LIBS})
