# One test program per room, made of the x_test.cc beside the code; ctest runs each as one test.
find_package(GTest REQUIRED)
file(GLOB MJSENSE_ROOMS RELATIVE ${PROJECT_SOURCE_DIR}/src/mjsense CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/mjsense/*)
foreach(room IN LISTS MJSENSE_ROOMS)
  file(GLOB_RECURSE tests CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/mjsense/${room}/*_test.cc)
  file(GLOB_RECURSE shared CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/mjsense/${room}/testing/*.cc)
  if(NOT MJSENSE_OPENGL)
    list(FILTER tests EXCLUDE REGEX "/opengl/")
  endif()
  if(tests)
    add_executable(${room}_test ${tests} ${shared})
    target_link_libraries(${room}_test PRIVATE mjsense ${MJSENSE_PRIVATE_LIBS} GTest::gtest GTest::gmock GTest::gtest_main)
    target_compile_options(${room}_test PRIVATE -Wall -Wextra -Wno-missing-field-initializers -Wno-maybe-uninitialized)
    add_test(NAME ${room} COMMAND ${room}_test)
  endif()
endforeach()

# Writes recordings that the Python tests read, kill and resume.
add_executable(record_fake ${PROJECT_SOURCE_DIR}/tests/record/fake_writer.cc
                           ${PROJECT_SOURCE_DIR}/src/mjsense/record/testing/fake_suite.cc)
target_link_libraries(record_fake PRIVATE mjsense ${MJSENSE_PRIVATE_LIBS})
