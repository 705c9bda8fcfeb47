# Debian packages, by `cpack --preset release` into build/release/packages; it needs dpkg-dev and file. Every
# install() names the package that its files belong to as its component.

# sgf_package(NAME SECTION section SUMMARY text DESCRIPTION text [DEPENDS package...] [RECOMMENDS package...])
# describes package NAME. What shared libraries its programs and libraries need, dpkg-shlibdeps finds out.
macro(sgf_package name)
  cmake_parse_arguments(PACKAGE "" "SECTION;SUMMARY;DESCRIPTION" "DEPENDS;RECOMMENDS" ${ARGN})
  string(TOUPPER "${name}" component)
  list(APPEND CPACK_COMPONENTS_ALL ${name})
  set(CPACK_COMPONENT_${component}_DESCRIPTION "${PACKAGE_SUMMARY}\n${PACKAGE_DESCRIPTION}")
  set(CPACK_DEBIAN_${component}_PACKAGE_NAME ${name})
  set(CPACK_DEBIAN_${component}_PACKAGE_SECTION ${PACKAGE_SECTION})
  list(JOIN PACKAGE_DEPENDS ", " CPACK_DEBIAN_${component}_PACKAGE_DEPENDS)
  list(JOIN PACKAGE_RECOMMENDS ", " CPACK_DEBIAN_${component}_PACKAGE_RECOMMENDS)
  install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/${name}"
    RENAME copyright COMPONENT ${name})
endmacro()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME sgf)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # else it is the first line of every description
set(CPACK_PACKAGE_VENDOR "The beyond-photometric contributors")
set(CPACK_PACKAGE_CONTACT "${CPACK_PACKAGE_VENDOR} <contributors@beyond-photometric.invalid>")
set(CPACK_PACKAGE_DIRECTORY "${PROJECT_BINARY_DIR}/packages")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS "${CMAKE_LIBRARY_OUTPUT_DIRECTORY}")
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY =)

# The packages in which find_package(sgf) finds what the libraries need.
sgf_package(libsgf-dev SECTION libdevel
  SUMMARY "gradient-based dissimilarities for stereo and visual odometry (development)"
  DESCRIPTION "Headers, static libraries, CMake package and examples of SGF, a dissimilarity
of image gradients that does not change when one image gets brighter or gains
contrast: stereo matchers for OpenCV, direct image alignment, visual odometry."
  DEPENDS libopencv-dev libeigen3-dev libfmt-dev libyaml-cpp-dev libtbb-dev libhwy-dev libceres-dev libopenexr-dev
          libssl-dev libembree-dev)
sgf_package(sgf-tools SECTION science
  SUMMARY "gradient-based dissimilarities for stereo and visual odometry (programs)"
  DESCRIPTION "Stereo matching, visual and stereo-inertial odometry, their scores, and a renderer
of stereo pairs and sequences with ground truth, from the command line.")
if(TARGET mrpt_sgf_odometry)
  sgf_package(mrpt-sgf-odometry SECTION science
    SUMMARY "visual odometry under changing light for MRPT"
    DESCRIPTION "Stereo, RGB-D and stereo-inertial odometry with gradient-based dissimilarities:
a library, a plug-in of rawlog-grabber, and programs that make rawlogs and
maps of recordings."
    RECOMMENDS mrpt-apps)
  # The deciders of graph SLAM and DataSourceSgfOdometry are headers over parts of MRPT that the library does not need.
  sgf_package(libmrpt-sgf-odometry-dev SECTION libdevel
    SUMMARY "visual odometry under changing light for MRPT (development)"
    DESCRIPTION "Headers, CMake package and examples of mrpt-sgf-odometry."
    DEPENDS "mrpt-sgf-odometry (= ${PROJECT_VERSION})" libmrpt-slam-dev libmrpt-hwdrivers-dev
    RECOMMENDS libmrpt-graphslam-dev libmrpt-apps-dev)
endif()
include(CPack)
