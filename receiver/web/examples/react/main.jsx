import "cuecast-player";
import { useState } from "react";
import { createRoot } from "react-dom/client";

function Programme({ src }) {
  const [keys, setKeys] = useState([]);
  const [place, setPlace] = useState("bottom-right");
  return (
    <>
      <cuecast-player base="/cuecast/" keys place={place} onkey={({ detail }) => setKeys((known) => [...known, detail])}>
        <video src={src} controls />
      </cuecast-player>
      <button onClick={() => setPlace("bottom-left")}>Left</button>
      <ol>{keys.map((key) => <li key={key.start}>{key.phones.join("")}: shape {key.shape}, {key.placement}</li>)}</ol>
    </>
  );
}

createRoot(document.getElementById("root")).render(<Programme src="/programme.mp4" />);
