# find_package(sgf) for projects that link the libraries, and examples of such.
include(CMakePackageConfigHelpers)

set(package_folder "${CMAKE_INSTALL_LIBDIR}/cmake/sgf")
# Each library is a component with an export set of its own, to be found without what only others need.
get_property(folders GLOBAL PROPERTY SGF_PUBLIC_FOLDERS)
foreach(folder IN LISTS folders)
  cmake_path(GET folder FILENAME library)
  get_target_property(needs sgf_library_${library} LINK_LIBRARIES)
  list(JOIN needs " " needs)
  string(APPEND SGF_LIBRARIES " ${library}")
  string(APPEND SGF_NEEDS "set(_sgf_needs_of_${library} ${needs})\n")
  install(EXPORT sgf-${library}-targets NAMESPACE sgf:: DESTINATION "${package_folder}" COMPONENT libsgf-dev)
endforeach()
configure_package_config_file("${CMAKE_CURRENT_LIST_DIR}/sgf-config.cmake.in"
  "${PROJECT_BINARY_DIR}/sgf-config.cmake" INSTALL_DESTINATION "${package_folder}")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/sgf-config-version.cmake"
  COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/sgf-config.cmake" "${PROJECT_BINARY_DIR}/sgf-config-version.cmake"
  DESTINATION "${package_folder}" COMPONENT libsgf-dev)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/docs/examples" DESTINATION "${CMAKE_INSTALL_DATADIR}/sgf" COMPONENT libsgf-dev)
