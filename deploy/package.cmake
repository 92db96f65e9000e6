# Installation and Debian packages: what goes where. `cmake --install build/release --prefix DIR` makes a tree that needs
# nothing of this one; `cpack` in build/release makes tenon_<version>_<architecture>.deb and tenon-doc_<version>_all.deb.

# ---- programs, beside each other: they start each other; the benchmark stays in the source tree
get_target_property(installed_programs programs MANUALLY_ADDED_DEPENDENCIES)
list(REMOVE_ITEM installed_programs tenon-bench console_page)
install(TARGETS ${installed_programs} RUNTIME DESTINATION lib/tenon COMPONENT tenon)
install(PROGRAMS tenon DESTINATION bin COMPONENT tenon)

# ---- what they read; parts of scenarios are made on the machine, by tenon-parts
install(DIRECTORY scenarios DESTINATION share/tenon COMPONENT tenon
        PATTERN part_generator EXCLUDE PATTERN *.png EXCLUDE)
install(FILES deploy/browser.py deploy/child.py deploy/demo.py deploy/demo_scene.py deploy/doctor.py deploy/doctor_link.py deploy/interrupt.py deploy/number_option.py deploy/opened.py deploy/picture.py DESTINATION share/tenon/deploy COMPONENT tenon)
install(DIRECTORY ${CMAKE_BINARY_DIR}/console_page ${CMAKE_BINARY_DIR}/report_page DESTINATION share/tenon COMPONENT tenon OPTIONAL PATTERN built EXCLUDE)
install(PROGRAMS clients/remote_hand/remote_hand.py DESTINATION share/tenon/clients/remote_hand COMPONENT tenon)
install(DIRECTORY deploy/dds DESTINATION share/tenon/deploy COMPONENT tenon)
install(PROGRAMS deploy/make-cert DESTINATION share/tenon/deploy COMPONENT tenon)
install(PROGRAMS deploy/systemd/serve_or_resume DESTINATION share/tenon/deploy/systemd COMPONENT tenon)
install(FILES deploy/systemd/tenon@.service DESTINATION share/tenon/deploy/systemd COMPONENT tenon)
file(WRITE ${CMAKE_BINARY_DIR}/VERSION "${PROJECT_VERSION}\n")
install(FILES ${CMAKE_BINARY_DIR}/VERSION DESTINATION share/tenon COMPONENT tenon)
install(FILES deploy/copyright DESTINATION share/doc/tenon COMPONENT tenon)

# ---- what people read: the pages of the source tree, and the pictures and tables they refer to
install(FILES deploy/copyright DESTINATION share/doc/tenon-doc COMPONENT doc)
file(GLOB pages CONFIGURE_DEPENDS RELATIVE ${CMAKE_SOURCE_DIR} *.md LICENSE docs/*.md docs/*.png deploy/packages/*.txt deploy/dds/*.xml deploy/wireguard.md deploy/PLANNING.md scenarios/scenario.schema.json scenarios/*/*.png
     server/*/pictures/*.svg tests/bench/engine/result/* tests/bench/stability/result/*)
foreach(page ${pages})
  get_filename_component(folder ${page} DIRECTORY)
  install(FILES ${page} DESTINATION share/doc/tenon/${folder} COMPONENT doc)
endforeach()

# ---- packages
set(CPACK_GENERATOR DEB)
set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_CURRENT_LIST_DIR}/package_needs.cmake)
set(CPACK_PACKAGE_CONTACT "The Tenon authors <tenon@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE
    WORLD_READ WORLD_EXECUTE)
set(CPACK_COMPONENTS_ALL tenon doc)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)

set(CPACK_DEBIAN_TENON_PACKAGE_NAME tenon)
set(CPACK_DEBIAN_TENON_PACKAGE_SECTION science)
set(CPACK_DEBIAN_TENON_PACKAGE_SHLIBDEPS ON)  # the libraries that the programs link
set(CPACK_DEBIAN_TENON_PACKAGE_DEPENDS python3)  # demo and doctor
set(CPACK_DEBIAN_TENON_PACKAGE_SUGGESTS "tenon-doc, xdg-utils, openssl, chromium")  # the demo opens its report in a browser; tenon cert; tenon picture
set(CPACK_COMPONENT_TENON_DESCRIPTION "virtual assembly training with force feedback
A trainee with two haptic arms mounts CAD parts into a scene, an instructor at
another station helps, observers follow; the session is recorded, can be run
again to the same bits and becomes a report. One server computes every contact
a thousand times a second; its clients reach it over DDS.

Devices are simulated ones in this version. See a whole session: tenon demo")

set(CPACK_DEBIAN_DOC_PACKAGE_NAME tenon-doc)
set(CPACK_DEBIAN_DOC_PACKAGE_SECTION doc)
set(CPACK_DEBIAN_DOC_PACKAGE_ARCHITECTURE all)
set(CPACK_COMPONENT_DOC_DESCRIPTION "virtual assembly training with force feedback: documentation
The map of Tenon's source, its decisions, its glossary and its guides, in
Markdown with their pictures.")
include(CPack)
