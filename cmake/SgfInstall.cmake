# find_package(sgf) for projects that link the libraries, and examples of such.
include(CMakePackageConfigHelpers)

set(package_folder "${CMAKE_INSTALL_LIBDIR}/cmake/sgf")
install(EXPORT sgf-targets NAMESPACE sgf:: DESTINATION "${package_folder}" COMPONENT libsgf-dev)
configure_package_config_file("${CMAKE_CURRENT_LIST_DIR}/sgf-config.cmake.in"
  "${PROJECT_BINARY_DIR}/sgf-config.cmake" INSTALL_DESTINATION "${package_folder}")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/sgf-config-version.cmake"
  COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/sgf-config.cmake" "${PROJECT_BINARY_DIR}/sgf-config-version.cmake"
  DESTINATION "${package_folder}" COMPONENT libsgf-dev)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/docs/examples" DESTINATION "${CMAKE_INSTALL_DATADIR}/sgf" COMPONENT libsgf-dev)
