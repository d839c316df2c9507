# find_package(mjsense): headers, the static library, and the libraries it needs found again in the same way.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
if(NOT SKBUILD)
  install(TARGETS mjsense mjsense_hdf5 EXPORT mjsenseTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(TARGETS mjsense_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  install(DIRECTORY src/mjsense DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h"
          PATTERN testing EXCLUDE)
  install(EXPORT mjsenseTargets NAMESPACE mjsense:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/mjsense)
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/mjsenseConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  configure_file(cmake/mjsenseConfig.cmake.in ${PROJECT_BINARY_DIR}/mjsenseConfig.cmake @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/mjsenseConfig.cmake ${PROJECT_BINARY_DIR}/mjsenseConfigVersion.cmake
                cmake/Dependencies.cmake DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/mjsense)
endif()
