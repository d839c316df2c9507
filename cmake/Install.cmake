# SPDX-License-Identifier: Apache-2.0
# Installs the files for find_package(mjsense [COMPONENTS tasks]): the public headers, the static libraries, and the search for their
# dependencies.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
if(NOT SKBUILD AND NOT MJSENSE_STATIC)
  install(TARGETS mjsense mjsense_hdf5 EXPORT mjsenseTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(TARGETS mjsense_tasks EXPORT mjsenseTasksTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  include(PublicHeaders)
  foreach(header IN LISTS MJSENSE_PUBLIC_HEADERS)
    get_filename_component(folder ${header} DIRECTORY)
    install(FILES src/${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder})
  endforeach()
  foreach(targets mjsenseTargets mjsenseTasksTargets)
    install(EXPORT ${targets} NAMESPACE mjsense:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/mjsense)
  endforeach()
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/mjsenseConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  configure_file(cmake/mjsenseConfig.cmake.in ${PROJECT_BINARY_DIR}/mjsenseConfig.cmake @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/mjsenseConfig.cmake ${PROJECT_BINARY_DIR}/mjsenseConfigVersion.cmake
                cmake/Dependencies.cmake DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/mjsense)
endif()
