import "cuecast-player";
import { createApp } from "vue";
import Programme from "./Programme.vue";

createApp(Programme, { src: "/programme.mp4" }).mount("#root");
