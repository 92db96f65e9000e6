declare module "*.css";
/** kProtocolVersion of idl/types/messages/session.h: build_page.cmake reads it. */
declare const TENON_PROTOCOL: number;
