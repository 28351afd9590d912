// Khronos' gltf-validator: prints the report of one file as JSON. Usage: node validate.cjs <node_modules' folder> <file>
const path = require("path");
const fs = require("fs");
const [home, file] = process.argv.slice(2);
const validator = require(path.join(path.resolve(home), "node_modules", "gltf-validator"));
validator.validateBytes(new Uint8Array(fs.readFileSync(file)), { uri: file, maxIssues: 1000 })
    .then((report) => console.log(JSON.stringify(report)))
    .catch((error) => { console.error(String(error)); process.exit(1); });
