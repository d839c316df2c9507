# Everything mjsense links. Debian packages (apt.txt) and the wheel mujoco-core; nothing is downloaded at configure time.

find_package(Threads REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(PCRE2 REQUIRED IMPORTED_TARGET libpcre2-8)

# MuJoCo lives in the wheel of the Python that configures us, so that the C++ library and `import mujoco` are one library.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter)
execute_process(
  COMMAND ${Python_EXECUTABLE} -c
          "import importlib.util as u; s = u.find_spec('mujoco'); print(s.submodule_search_locations[0] if s else '')"
  OUTPUT_VARIABLE MUJOCO_DIR OUTPUT_STRIP_TRAILING_WHITESPACE)
file(GLOB MUJOCO_LIBRARY "${MUJOCO_DIR}/libmujoco.so.4.0.*")
if(NOT MUJOCO_DIR OR NOT MUJOCO_LIBRARY)
  message(FATAL_ERROR "MuJoCo 4.0 not found in ${Python_EXECUTABLE}: run ./dev setup, or pip install 'mujoco-core==4.0.*' "
                      "there, or name another Python by -DPython_EXECUTABLE=...")
endif()
add_library(mujoco::mujoco SHARED IMPORTED GLOBAL)
set_target_properties(mujoco::mujoco PROPERTIES IMPORTED_LOCATION ${MUJOCO_LIBRARY}
                                                INTERFACE_INCLUDE_DIRECTORIES ${MUJOCO_DIR}/include)

# Embree 4 if found, else 3 (Debian 12); rays/embree.h hides the difference.
find_package(embree 4 QUIET)
if(NOT embree_FOUND)
  find_package(embree 3 REQUIRED)
endif()

# The serial HDF5 C library, static, so that a file written here never depends on a user's libhdf5.
find_library(HDF5_STATIC NAMES libhdf5.a PATHS /usr/lib/x86_64-linux-gnu/hdf5/serial /usr/lib/aarch64-linux-gnu/hdf5/serial)
find_path(HDF5_INCLUDE hdf5.h PATHS /usr/include/hdf5/serial)
find_library(SZ_STATIC libsz.a)
find_library(AEC_STATIC libaec.a)
if(NOT HDF5_STATIC OR NOT HDF5_INCLUDE)
  message(FATAL_ERROR "libhdf5.a not found: apt-get install libhdf5-dev")
endif()
find_package(ZLIB REQUIRED)
add_library(mjsense_hdf5 INTERFACE)
target_include_directories(mjsense_hdf5 INTERFACE $<BUILD_INTERFACE:${HDF5_INCLUDE}>)
target_link_libraries(mjsense_hdf5 INTERFACE ${HDF5_STATIC} ${SZ_STATIC} ${AEC_STATIC} ZLIB::ZLIB ${CMAKE_DL_LIBS} m)

set(MJSENSE_PRIVATE_LIBS fmt::fmt nlohmann_json::nlohmann_json PkgConfig::PCRE2 embree mjsense_hdf5 Threads::Threads)
