# SPDX-License-Identifier: Apache-2.0
# Static libraries for the wheel, built by packaging/libraries.sh. Only the linker's input differs from other builds: headers, and
# therefore object files, are the same.
set(MJSENSE_STATIC_DIR ${PROJECT_SOURCE_DIR}/build/wheel/lib)
if(CMAKE_CROSSCOMPILING)
  set(MJSENSE_STATIC_DIR ${PROJECT_SOURCE_DIR}/build/wheel_${CMAKE_SYSTEM_PROCESSOR}/lib)
endif()
if(NOT EXISTS ${MJSENSE_STATIC_DIR}/libembree.a)
  message(FATAL_ERROR "MJSENSE_STATIC: no libraries in ${MJSENSE_STATIC_DIR}: run ./dev wheel")
endif()
find_library(PCRE2_STATIC libpcre2-8.a REQUIRED)
find_library(DEFLATE_STATIC libdeflate.a REQUIRED)
find_library(ZLIB_STATIC libz.a REQUIRED)

# mjsense_static(NAME LIKE ARCHIVE...): a target with the includes and definitions of LIKE that links the archives.
function(mjsense_static name like)
  add_library(${name} INTERFACE)
  foreach(what INCLUDE_DIRECTORIES SYSTEM_INCLUDE_DIRECTORIES COMPILE_DEFINITIONS COMPILE_OPTIONS)
    get_target_property(value ${like} INTERFACE_${what})
    if(value)
      set_target_properties(${name} PROPERTIES INTERFACE_${what} "${value}")
    endif()
  endforeach()
  target_link_libraries(${name} INTERFACE ${ARGN})
endfunction()
mjsense_static(mjsense_static_fmt fmt::fmt ${MJSENSE_STATIC_DIR}/libfmt.a)
mjsense_static(mjsense_static_pcre2 PkgConfig::PCRE2 ${PCRE2_STATIC})
mjsense_static(mjsense_static_deflate PkgConfig::DEFLATE ${DEFLATE_STATIC})
mjsense_static(mjsense_static_embree embree ${MJSENSE_STATIC_DIR}/libembree.a)
mjsense_static(mjsense_static_ompl ompl::ompl ${MJSENSE_STATIC_DIR}/libompl.a)
mjsense_static(mjsense_static_hdf5 mjsense_hdf5 ${HDF5_STATIC} ${SZ_STATIC} ${AEC_STATIC} ${ZLIB_STATIC} ${CMAKE_DL_LIBS} m)
set(MJSENSE_PRIVATE_LIBS mjsense_static_fmt nlohmann_json::nlohmann_json mjsense_static_pcre2 mjsense_static_deflate
                         mjsense_static_embree mjsense_static_hdf5 Threads::Threads)
set(MJSENSE_TASKS_PRIVATE_LIBS mjsense_static_fmt nlohmann_json::nlohmann_json mjsense_static_ompl)

# Links libstdc++ statically and uses glibc's symbol versions chosen by packaging/libraries.sh.
set(MJSENSE_STATIC_LINK -static-libstdc++ -L${MJSENSE_STATIC_DIR}/glibc -Wl,-rpath-link,${MJSENSE_STATIC_DIR}/glibc
                        -Wl,--version-script=${PROJECT_SOURCE_DIR}/packaging/exports.map -Wl,--gc-sections -pthread)

# The licenses of these libraries are added to the wheel.
foreach(package fmt nlohmann-json3 tomlplusplus pcre2 embree ompl eigen3 boost hdf5 aec deflate xxhash zlib1g)
  find_file(MJSENSE_LICENCE_${package} copyright PATHS ${CMAKE_SYSROOT}/usr/share/doc/lib${package}-dev ${CMAKE_SYSROOT}/usr/share/doc/${package}-dev
            NO_DEFAULT_PATH REQUIRED)
  if(SKBUILD)
    install(FILES ${MJSENSE_LICENCE_${package}} DESTINATION ${SKBUILD_METADATA_DIR}/licenses RENAME ${package} COMPONENT python)
  endif()
endforeach()
