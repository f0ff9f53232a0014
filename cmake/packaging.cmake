# A Debian package by CPack: deploy/package.sh builds what goes into it and then runs `cpack -G DEB` in the build folder.
set(package_folder ${PROJECT_SOURCE_DIR}/deploy/package)
set(package_made ${PROJECT_BINARY_DIR}/package)
include(GNUInstallDirs)
# CPack would build everything, tests included.
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)

# Made from the built program and client: what they say of themselves and what they hold.
find_package(Python3 COMPONENTS Interpreter)
if(Python3_FOUND)
  add_custom_target(package_files
    COMMAND ${CMAKE_COMMAND} -E make_directory ${package_made}
    COMMAND ${Python3_EXECUTABLE} ${package_folder}/describe.py man $<TARGET_FILE:spectra> > ${package_made}/spectra.1
    COMMAND gzip -9nkf ${package_made}/spectra.1
    COMMAND ${Python3_EXECUTABLE} ${package_folder}/describe.py completion $<TARGET_FILE:spectra> > ${package_made}/spectra
    COMMAND ${Python3_EXECUTABLE} ${package_folder}/notices.py ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR}/web/dist > ${package_made}/licences.txt
    COMMAND gzip -9nc ${package_made}/licences.txt > ${package_made}/third-party-notices.gz
    COMMAND gzip -9nc ${PROJECT_SOURCE_DIR}/CHANGELOG.md > ${package_made}/CHANGELOG.md.gz
    DEPENDS spectra VERBATIM)
endif()

install(TARGETS spectra RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY web/dist/ DESTINATION share/spectra/web PATTERN ".has_module" EXCLUDE)
install(FILES ${package_made}/licences.txt DESTINATION share/spectra/web)
install(FILES ${package_made}/spectra.1.gz DESTINATION share/man/man1)
install(FILES ${package_made}/spectra DESTINATION share/bash-completion/completions)
install(FILES ${package_made}/third-party-notices.gz ${package_made}/CHANGELOG.md.gz ${package_folder}/copyright
  docs/operations.md docs/access.md docs/ingest.md docs/limits.md docs/reliability.md docs/store.md DESTINATION share/doc/spectra)
install(DIRECTORY deploy/proxy/ DESTINATION share/doc/spectra/examples)
install(PROGRAMS ${package_folder}/hand-over DESTINATION lib/spectra)
# Not GNUInstallDirs' lib/x86_64-linux-gnu: systemd looks here.
install(FILES ${package_folder}/spectra.service DESTINATION /lib/systemd/system)
install(FILES deploy/spectra.toml DESTINATION /etc/spectra)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME spectra)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "The authors of Spectra <spectra@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "fuses visible and thermal 3D scenes and streams them to browsers")
set(CPACK_PACKAGE_DESCRIPTION "A server for a robot or a desk: it keeps a mesh with visible colours and\n\
temperatures, fuses both into one picture, and streams it to any number of\n\
browsers while the map grows.\nThe service listens on loopback until\n/etc/spectra/spectra.toml says otherwise.")
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA
  ${package_folder}/postinst ${package_folder}/prerm ${package_folder}/postrm ${package_folder}/conffiles)
include(CPack)
