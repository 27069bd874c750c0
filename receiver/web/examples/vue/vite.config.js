import vue from "@vitejs/plugin-vue";

const isCustomElement = (tag) => tag.startsWith("cuecast-");

export default { plugins: [vue({ template: { compilerOptions: { isCustomElement } } })] };
