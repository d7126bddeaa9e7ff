// Shows the API's description; a key that is given by "Authorize" is forgotten with the tab.
window.SwaggerUIBundle({ url: "/openapi.json", dom_id: "#swagger-ui", deepLinking: true });
