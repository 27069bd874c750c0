/** The style sheets, as `receiver.web.build` joins them. */
export const STYLE: string;
